// The slider under the picture: a second before and after the keyframe, for context.
import { byId, setText } from "./dom.js";

export function createScrub(model, actions) {
  const slider = byId("look");
  slider.addEventListener("input", () => actions.look(Number(slider.value)));
  byId("look-back").addEventListener("click", () => actions.look(model.doing.look - 1));
  byId("look-ahead").addEventListener("click", () => actions.look(model.doing.look + 1));

  return {
    draw() {
      const { frame, look } = model.doing,
        { fps, time, n_frames: count } = model.project;
      const reach = Math.round(fps);
      slider.min = -Math.min(reach, frame);
      slider.max = Math.min(reach, count - 1 - frame);
      slider.value = look;
      const at = frame + look,
        seconds = time?.[at] ?? at / fps;
      setText(byId("where"), `frame ${at} of ${count}, ${seconds.toFixed(2)} s`);
      byId("away").hidden = look === 0;
      setText(byId("away"), `${look > 0 ? "+" : "−"}${Math.abs(look)} frames from the keyframe`);
    },
  };
}
