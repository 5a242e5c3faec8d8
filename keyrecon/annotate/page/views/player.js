// A clock that plays frames. A frame whose picture is not here yet holds the clock up, so that the
// picture and what is drawn over it always belong together.
export function createPlayer({ fps, last, ready, load, show, active }) {
  let playing = null; // {frame, since}: where and when the clock was set

  function step(now) {
    if (!playing || !active()) {
      playing = null;
      return;
    }
    const due = playing.frame + Math.floor(((now - playing.since) * fps) / 1000);
    const frame = Math.min(last, due);
    if (ready(frame)) {
      show(frame);
    } else {
      load(playing.frame + 1);
      if (ready(playing.frame + 1)) playing.frame += 1;
      playing.since = now;
      show(playing.frame);
    }
    if (frame >= last) playing = null;
    requestAnimationFrame(step);
  }

  return {
    playing: () => playing !== null,
    stop() {
      playing = null;
    },
    start(frame) {
      playing = { frame: frame >= last ? 0 : frame, since: performance.now() };
      requestAnimationFrame(step);
    },
  };
}
