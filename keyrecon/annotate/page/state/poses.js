// What the server computes of a keyframe: the pose in space of what is placed, and the suggestion of
// where its joints are.
import * as api from "./api.js";

export function createPoses(model) {
  const poses = new Map(), // frame -> answer
    suggestions = new Map();
  let asked = "",
    lost = false, // whether an answer did not come
    pending = Promise.resolve();

  function noteLost(fault) {
    lost ||= fault instanceof api.Gone;
    throw fault;
  }

  const request = api.latestOnly(
    async (frame, marks, nearer) => {
      const began = performance.now(),
        answer = await api.send("pose", { frame, marks, nearer }).catch(noteLost);
      poses.set(frame, answer);
      model.redraw();
      performance.measure("pose", { start: began, end: performance.now() });
    },
    (fault, frame) => {
      poses.set(frame, { trouble: fault.message });
      model.redraw();
    },
  );

  const requestSuggestion = api.latestOnly(
    async (frame) => {
      const answer = await api.read(`suggestion/${frame}`).catch(noteLost);
      suggestions.set(frame, answer.joints ? answer : null);
      model.redraw();
    },
    (fault, frame) => suggestions.delete(frame), // nothing is known yet that could be suggested
  );

  // Asks for the pose when what is placed has changed; a promise when it did, else null.
  function refresh() {
    const { frame } = model.ui,
      marks = model.placed(),
      nearer = model.nearer();
    const now = JSON.stringify([frame, marks, nearer]);
    if (frame === null || now === asked) return null;
    asked = now;
    pending = request(frame, marks, nearer);
    return pending;
  }

  // The pose is then asked for when the page is drawn.
  function askAnew() {
    lost = false;
    asked = "";
    if (model.ui.frame !== null) requestSuggestion(model.ui.frame);
  }
  model.onProject(askAnew); // once the player was followed there is more to make them from

  return {
    refresh,
    requestSuggestion,
    // Asks again for what did not come while the server was gone.
    askAgain() {
      if (lost) askAnew();
    },
    // Whether no later request has been made than the one of this promise.
    isLatest: (promise) => promise === pending,
    current: () => poses.get(model.ui.frame) ?? null,
    // Nothing is suggested where nothing is to be marked.
    suggestion() {
      const keyframe = model.keyframe();
      if (keyframe && model.isDone(keyframe)) return null;
      return suggestions.get(model.ui.frame) ?? null;
    },
    // The pose of what is marked at this moment.
    async latest() {
      refresh();
      await pending;
      return poses.get(model.ui.frame) ?? null;
    },
  };
}
