// The motion as the server has it, fetched in stretches of frames as they are needed.
import * as api from "./api.js";

const LENGTH = 250; // frames asked for at a time

export function createStretches(project, arrived) {
  let stretches = new Map(); // number -> answer, null while it is on its way

  async function ask(number) {
    const mine = stretches;
    mine.set(number, null);
    const from = number * LENGTH,
      to = Math.min(project.n_frames, from + LENGTH);
    const answer = await api.read(`motion?from=${from}&to=${to}`).catch(() => null);
    if (answer?.points3d) mine.set(number, answer);
    else mine.delete(number); // asked again when it is needed again
    arrived();
  }

  return {
    // {joint: point} of a frame, kind "points2d" or "points3d"; null while it is not known.
    points(frame, kind) {
      const number = Math.floor(frame / LENGTH);
      if (!stretches.has(number)) ask(number);
      const row = stretches.get(number)?.[kind][frame - number * LENGTH];
      if (!row) return null;
      const named = row.map((point, joint) => [project.joints[joint], point]);
      return Object.fromEntries(named.filter(([, point]) => point && point[0] !== null));
    },
    forget() {
      stretches = new Map();
    },
  };
}
