// A clock that plays frames. A frame whose picture is not here yet holds the clock up, so that the
// picture and what is drawn over it always belong together.
export function createPlayer({ fps, last, ready, load, show, active }) {
  let playing = null; // {frame, since, shown}: where and when the clock was set, what it shows now

  function step(now) {
    if (!playing || !active()) {
      playing = null;
      return;
    }
    const due = Math.min(last, playing.frame + Math.floor(((now - playing.since) * fps) / 1000));
    if (ready(due)) playing.shown = due;
    else holdUp(now);
    show(playing.shown);
    if (playing.shown >= last) playing = null;
    else requestAnimationFrame(step);
  }

  // What is due is late: the next picture is waited for, and time goes on from there.
  function holdUp(now) {
    const next = playing.shown + 1;
    load(next);
    if (ready(next)) playing.shown = next;
    Object.assign(playing, { frame: playing.shown, since: now });
  }

  return {
    playing: () => playing !== null,
    stop() {
      playing = null;
    },
    start(frame) {
      const first = frame >= last ? 0 : frame;
      playing = { frame: first, since: performance.now(), shown: first };
      requestAnimationFrame(step);
    },
  };
}
