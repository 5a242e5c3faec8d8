// What is fetched from the server ahead of being drawn: frames as pictures, and the motion.
import { groundLevel } from "../../../report/ground_level.js";
import * as api from "./api.js";

const CACHE_BYTES = 260e6; // of decoded pictures
// Requests at a time: a browser opens six connections to a server, and edits must never wait for
// pictures.
const PREFETCH_REQUESTS = 2;
const URGENT_REQUESTS = 3;
const MAX_URGENT = 16; // pictures that were to be drawn and are not here yet
const RETRY = 1000; // milliseconds until what did not come is asked for again
const CHUNK = 250; // frames of the motion asked for at a time
const AHEAD = 100; // frames before the next of them in which it is asked for

// Exact frames as pictures, kept ready to draw while there is room. `ready` is called for each picture, and
// where one did not come, so that it is asked for again if it is still to be drawn; `failed` with the reason
// where a frame has none: once, it would fail again.
export function createFrameCache(project, ready, failed) {
  const kept = new Map(); // key -> picture, oldest use first
  const loading = new Set(),
    broken = new Set();
  let prefetched = [],
    urgent = [],
    bytes = 0;

  const key = (frame, width) => `${frame}/${width ?? 0}`;

  function address(frame, width) {
    const parts = new URLSearchParams();
    if (width) parts.set("width", width);
    parts.set("v", project.version);
    return `/api/frame/${frame}?${parts}`;
  }

  async function fetchOne(frame, width) {
    const response = await fetch(address(frame, width), { credentials: "same-origin" });
    if (response.ok) return createImageBitmap(await response.blob());
    if (response.status === 400) {
      broken.add(key(frame, width));
      failed((await response.json()).error);
    }
    throw new Error(`frame ${frame}: ${response.status}`);
  }

  function keep(name, picture) {
    kept.set(name, picture);
    bytes += picture.width * picture.height * 4;
    for (const [oldest, old] of kept) {
      if (bytes <= CACHE_BYTES || oldest === name) break;
      bytes -= old.width * old.height * 4;
      kept.delete(oldest);
      old.close();
    }
  }

  function load(frame, width) {
    const name = key(frame, width);
    if (kept.has(name) || loading.has(name) || broken.has(name)) return;
    loading.add(name);
    fetchOne(frame, width)
      .then((picture) => {
        keep(name, picture);
        ready(frame);
      })
      .catch(() => broken.has(name) || setTimeout(() => ready(frame), RETRY))
      .finally(() => {
        loading.delete(name);
        loadMore();
      });
  }

  // What is to be drawn now comes first, the newest request before older ones.
  function loadMore() {
    while (urgent.length && loading.size < URGENT_REQUESTS) load(...urgent.pop());
    while (prefetched.length && loading.size < PREFETCH_REQUESTS) load(...prefetched.shift());
  }

  return {
    address,
    // The picture if it is here; asks for it before all others if not.
    get(frame, width) {
      const name = key(frame, width),
        picture = kept.get(name);
      if (!picture) {
        const others = urgent.filter((one) => key(...one) !== name);
        urgent = [...others, [frame, width]].slice(-MAX_URGENT);
        loadMore();
        return null;
      }
      kept.delete(name);
      kept.set(name, picture);
      return picture;
    },
    has: (frame, width) => kept.has(key(frame, width)),
    // What is likely to be drawn next, in order; replaces what was to be prefetched before.
    prefetch(list) {
      prefetched = list.filter(([frame]) => frame >= 0 && frame < project.n_frames);
      loadMore();
    },
  };
}

export function createMotionCache(project, arrived) {
  let chunks = new Map(); // number -> answer, null while it is on its way

  async function load(number) {
    const current = chunks;
    current.set(number, null);
    const from = number * CHUNK,
      to = Math.min(project.n_frames, from + CHUNK);
    const answer = await api.read(`motion?from=${from}&to=${to}`).catch(() => null);
    if (answer?.points3d) current.set(number, answer);
    else {
      await new Promise((done) => setTimeout(done, RETRY));
      current.delete(number); // loaded again when it is needed again
    }
    arrived();
  }

  return {
    // {joint: point} of a frame, kind "points2d" or "points3d"; null while it is not known.
    points(frame, kind) {
      const number = Math.floor(frame / CHUNK),
        ahead = Math.floor(Math.min(project.n_frames - 1, frame + AHEAD) / CHUNK);
      for (const wanted of new Set([number, ahead])) if (!chunks.has(wanted)) load(wanted);
      const row = chunks.get(number)?.[kind][frame - number * CHUNK];
      if (!row) return null;
      const named = row.map((point, joint) => [project.joints[joint], point]);
      const known = named.filter(([, point]) => point && point[0] !== null);
      return known.length ? Object.fromEntries(known) : null;
    },
    // Whether what is known of a frame has arrived.
    isHere: (frame) => Boolean(chunks.get(Math.floor(frame / CHUNK))),
    // {level, unit, units} of a frame: the height of the ground, that of the lower foot on average over
    // half a second, and the player's stature; null while it is not known.
    ground(frame) {
      const number = Math.floor(frame / CHUNK),
        chunk = chunks.get(number);
      if (!chunk) return null;
      const lowest = chunk.points3d.map((row) => Math.max(...row.map((point) => point?.[1] ?? NaN))),
        radius = Math.max(1, Math.round(project.fps / 4)),
        cuts = new Set(chunk.cuts.map((cut) => cut - number * CHUNK)),
        level = groundLevel(lowest, frame - number * CHUNK, radius, cuts);
      if (Number.isNaN(level)) return null;
      return { level, unit: chunk.stature, units: chunk.units };
    },
    // {joint: px}: how far off each joint probably is; null while it is not known.
    errors(frame) {
      const number = Math.floor(frame / CHUNK),
        row = chunks.get(number)?.expected_error?.[frame - number * CHUNK];
      const named = (row ?? []).map((px, joint) => [project.joints[joint], px]),
        known = named.filter(([, px]) => px !== null);
      return known.length ? Object.fromEntries(known) : null;
    },
    forget() {
      chunks = new Map();
    },
  };
}
