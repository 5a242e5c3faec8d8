// The court, or the ground in squares of a metre, from above with the player's way, at the frame of the page's cursor. Metres on the court:
// x along the net to the right, y up the court, the camera's end below.
import { cssColor } from "./colors.js";
import { byId, data, count, cuts, seconds, frame, show, followers, restyled } from "./cursor.js";
import { unpack } from "./packed.js";
import { prepareCanvas } from "./figure3d.js";

const SURFACE = "#34548a",
  SURROUND = "#40695a",
  LINE = "#f5f5f5",
  GRID = "#80a092",
  NET = "#ffdc00";
const RAMP = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]]; // viridis
const MARGIN = { top: 8, left: 8, right: 92, bottom: 8 };
const NEAR = 18; // px from the way within which a press goes to its frame
const SAMPLES = 24; // of the colour scale

export function rampColor(share) {
  const at = Math.max(0, Math.min(1, share || 0)) * (RAMP.length - 1),
    low = Math.min(RAMP.length - 2, Math.floor(at));
  const mixed = RAMP[low].map((part, n) => Math.round(part + (RAMP[low + 1][n] - part) * (at - low)));
  return `rgb(${mixed.join(" ")})`;
}

function createMap(canvas, court) {
  const root = unpack(court.root, cuts).values,
    speed = unpack(court.speed, cuts).values,
    heat = unpack(court.heat.seconds);
  const [left, near, right, far] = court.frame,
    top = speed.reduce((most, value) => (value > most ? value : most), 0.1),
    warmest = heat.values.reduce((most, value) => Math.max(most, value), 1e-9);
  const known = (t) => Number.isFinite(root[2 * t]);
  let kind = "speed",
    place = null;

  const last = seconds(count - 1);
  const KINDS = {
    speed: { share: (t) => speed[t] / top, ends: ["0", `${top.toFixed(1)} m/s`] },
    time: { share: (t) => seconds(t) / last, ends: ["start", `${last.toFixed(1)} s`] },
    heat: { ends: ["0", `${warmest.toFixed(1)} s/m²`] },
  };

  function drawHeat(pen, at, scale) {
    const [rows, columns] = heat.shape,
      side = court.heat.cell * scale + 0.6;
    for (let row = 0; row < rows; row++)
      for (let column = 0; column < columns; column++) {
        const share = heat.values[row * columns + column] / warmest;
        if (share < 0.02) continue;
        const [x, y] = at(left + column * court.heat.cell, near + (row + 1) * court.heat.cell);
        pen.globalAlpha = Math.min(1, 0.25 + share);
        pen.fillStyle = rampColor(share);
        pen.fillRect(x, y, side, side);
      }
    pen.globalAlpha = 1;
  }

  function drawWay(pen, at) {
    pen.lineWidth = 3;
    pen.lineCap = "round";
    for (let t = 1; t < count; t++) {
      if (!known(t) || !known(t - 1) || cuts.has(t)) continue;
      pen.strokeStyle = rampColor(KINDS[kind].share(t));
      pen.beginPath();
      pen.moveTo(...at(root[2 * t - 2], root[2 * t - 1]));
      pen.lineTo(...at(root[2 * t], root[2 * t + 1]));
      pen.stroke();
    }
  }

  function drawScale(pen, [width, height]) {
    const x = width - MARGIN.right + 14,
      length = Math.min(180, height - 40);
    for (let n = 0; n < SAMPLES; n++) {
      pen.fillStyle = rampColor(1 - n / (SAMPLES - 1));
      pen.fillRect(x, 18 + (n * length) / SAMPLES, 12, length / SAMPLES + 1);
    }
    pen.fillStyle = cssColor("ink");
    pen.font = "12px system-ui, sans-serif";
    pen.textBaseline = "middle";
    pen.fillText(KINDS[kind].ends[1], x, 9);
    pen.fillText(KINDS[kind].ends[0], x, 28 + length);
  }

  function draw() {
    const [pen, width, height] = prepareCanvas(canvas);
    const scale = Math.min(
      (width - MARGIN.left - MARGIN.right) / (right - left),
      (height - MARGIN.top - MARGIN.bottom) / (far - near),
    );
    const at = (x, y) => [MARGIN.left + (x - left) * scale, MARGIN.top + (far - y) * scale];
    place = at;
    const [x0, y0] = at(left, far),
      [x1, y1] = at(right, near);
    pen.save();
    pen.beginPath();
    pen.rect(x0, y0, x1 - x0, y1 - y0);
    pen.clip();
    pen.fillStyle = SURROUND;
    pen.fillRect(x0, y0, x1 - x0, y1 - y0);
    if (court.surface) {
      const [wide, long] = court.surface,
        [sx, sy] = at(-wide, long),
        [ex, ey] = at(wide, -long);
      pen.fillStyle = SURFACE;
      pen.fillRect(sx, sy, ex - sx, ey - sy);
    }
    if (kind === "heat") drawHeat(pen, at, scale);
    for (const [a, b] of court.lines) {
      pen.strokeStyle = a[2] || b[2] ? NET : court.surface ? LINE : GRID;
      pen.lineWidth = court.surface ? Math.max(1.5, 0.05 * scale) : 1;
      pen.beginPath();
      pen.moveTo(...at(a[0], a[1]));
      pen.lineTo(...at(b[0], b[1]));
      pen.stroke();
    }
    if (kind !== "heat") drawWay(pen, at);
    pen.restore();
    drawNow(pen, at);
    drawScale(pen, [width, height]);
  }

  function drawNow(pen, at) {
    const t = frame(),
      [x, y] = [root[2 * t], root[2 * t + 1]];
    byId("court-now").textContent = known(t)
      ? `${speed[t].toFixed(1)} m/s${court.surface ? fromBaseline(y) : ""}`
      : `the ${court.origin} is not known in this frame`;
    if (!known(t)) return;
    const [px, py] = at(x, y);
    pen.fillStyle = "#fff";
    pen.strokeStyle = "#14161a";
    pen.lineWidth = 2.5;
    pen.beginPath();
    pen.arc(px, py, 7, 0, 2 * Math.PI);
    pen.fill();
    pen.stroke();
  }

  function fromBaseline(y) {
    const [, long] = court.surface;
    return `, ${Math.abs(Math.abs(y) - long).toFixed(1)} m ${Math.abs(y) > long ? "behind" : "inside"} the baseline`;
  }

  // The frame whose place is nearest to a point of the canvas; of several passes the one nearest in time.
  function frameAt(x, y) {
    let best = null,
      least = NEAR;
    for (let t = 0; t < count; t++) {
      if (!known(t)) continue;
      const [px, py] = place(root[2 * t], root[2 * t + 1]),
        away = Math.hypot(px - x, py - y) + Math.abs(t - frame()) * 0.002;
      if (away < least) [best, least] = [t, away];
    }
    return best;
  }

  const go = (event) => {
    if (!event.buttons || !place) return;
    const found = frameAt(event.offsetX, event.offsetY);
    if (found !== null) show(found);
  };
  canvas.addEventListener("pointerdown", go);
  canvas.addEventListener("pointermove", go);
  const buttons = [...document.querySelectorAll("[data-map]")];
  const choose = (wanted) => {
    kind = wanted;
    for (const button of buttons) button.setAttribute("aria-pressed", button.dataset.map === kind);
    draw();
  };
  for (const button of buttons) button.addEventListener("click", () => choose(button.dataset.map));
  canvas.style.aspectRatio = `${right - left + (MARGIN.right + 8) / 30} / ${far - near}`;
  new ResizeObserver(draw).observe(canvas);
  followers.push(draw);
  restyled.push(draw);
  choose("speed");
}

if (data.court) createMap(byId("court-map"), data.court);
