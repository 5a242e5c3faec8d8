// Exact frames as pictures, fetched ahead and kept ready to draw while there is room.

const ROOM = 260e6; // bytes of decoded pictures
// Requests at a time: a browser opens six connections to a server, and edits must never wait for
// pictures.
const AHEAD = 2;
const URGENT = 3;
const REMEMBERED = 16; // pictures that were to be drawn and are not here yet

// `ready` hears of each picture, `failed` why a frame has none: once, it would fail again.
export function createStills(project, ready, failed) {
  const kept = new Map(); // key -> picture, oldest use first
  const coming = new Set(),
    broken = new Set();
  let wanted = [],
    urgent = [],
    room = 0;

  const key = (frame, width) => `${frame}/${width ?? 0}`;

  function address(frame, width) {
    const parts = new URLSearchParams();
    if (width) parts.set("width", width);
    parts.set("v", project.version);
    return `/api/still/${frame}?${parts}`;
  }

  async function fetchOne(frame, width) {
    const response = await fetch(address(frame, width), { credentials: "same-origin" });
    if (response.ok) return createImageBitmap(await response.blob());
    if (response.status === 400) {
      broken.add(key(frame, width));
      failed((await response.json()).error);
    }
    throw new Error(`still ${frame}: ${response.status}`);
  }

  function keep(name, picture) {
    kept.set(name, picture);
    room += picture.width * picture.height * 4;
    for (const [oldest, old] of kept) {
      if (room <= ROOM || oldest === name) break;
      room -= old.width * old.height * 4;
      kept.delete(oldest);
      old.close();
    }
  }

  function load(frame, width) {
    const name = key(frame, width);
    if (kept.has(name) || coming.has(name) || broken.has(name)) return;
    coming.add(name);
    fetchOne(frame, width)
      .then((picture) => {
        keep(name, picture);
        ready(frame);
      })
      .catch(() => {}) // asked for again when it is to be drawn again
      .finally(() => {
        coming.delete(name);
        work();
      });
  }

  // What is to be drawn now comes first, the newest wish before older ones.
  function work() {
    while (urgent.length && coming.size < URGENT) load(...urgent.pop());
    while (wanted.length && coming.size < AHEAD) load(...wanted.shift());
  }

  return {
    // The picture if it is here; asks for it before all others if not.
    get(frame, width) {
      const name = key(frame, width),
        picture = kept.get(name);
      if (!picture) {
        urgent = [...urgent.filter((one) => key(...one) !== name), [frame, width]].slice(
          -REMEMBERED,
        );
        work();
        return null;
      }
      kept.delete(name);
      kept.set(name, picture);
      return picture;
    },
    has: (frame, width) => kept.has(key(frame, width)),
    // What is likely to be looked at next, in order; replaces what was wished for before.
    wish(list) {
      wanted = list.filter(([frame]) => frame >= 0 && frame < project.n_frames);
      work();
    },
  };
}
