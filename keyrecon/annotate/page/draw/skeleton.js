// The skeleton over the picture. Sides differ by colour and by shape: left is a blue circle, right an
// orange square, the middle a white diamond. A limb is a wedge, broad at the end nearer the camera.
import { CASING } from "./canvas.js";

const TAU = 2 * Math.PI;
const BROAD = 4.5,
  NARROW = 1,
  FLAT = 2; // half widths of a limb, px

function outline(pen, shape, [x, y], size) {
  pen.beginPath();
  if (shape === "left") pen.arc(x, y, size, 0, TAU);
  else if (shape === "right") pen.rect(x - size * 0.9, y - size * 0.9, size * 1.8, size * 1.8);
  else {
    pen.moveTo(x, y - size * 1.25);
    pen.lineTo(x + size * 1.25, y);
    pen.lineTo(x, y + size * 1.25);
    pen.lineTo(x - size * 1.25, y);
    pen.closePath();
  }
}

// style: {side, color, hollow, alpha, size, ring}
export function drawJoint(pen, place, style) {
  const size = style.size ?? 5;
  pen.save();
  pen.globalAlpha = style.alpha ?? 1;
  if (style.ring) {
    pen.beginPath();
    pen.arc(...place, size + 6, 0, TAU);
    pen.strokeStyle = CASING;
    pen.lineWidth = 4;
    pen.stroke();
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1.75;
    pen.stroke();
  }
  outline(pen, style.side, place, size);
  pen.strokeStyle = CASING;
  pen.lineWidth = style.hollow ? 5 : 3;
  pen.stroke();
  if (style.hollow) {
    pen.strokeStyle = style.color;
    pen.lineWidth = 2;
    pen.stroke();
  } else {
    pen.fillStyle = style.color;
    pen.fill();
  }
  pen.restore();
}

// A wedge from parent to child; sign 1: the child end is nearer, -1 farther, 0 not known.
function wedge(pen, [ax, ay], [bx, by], sign) {
  const length = Math.hypot(bx - ax, by - ay) || 1;
  const [nx, ny] = [(ay - by) / length, (bx - ax) / length];
  const a = sign > 0 ? NARROW : sign < 0 ? BROAD : FLAT,
    b = sign > 0 ? BROAD : sign < 0 ? NARROW : FLAT;
  pen.beginPath();
  pen.moveTo(ax + nx * a, ay + ny * a);
  pen.lineTo(bx + nx * b, by + ny * b);
  pen.lineTo(bx - nx * b, by - ny * b);
  pen.lineTo(ax - nx * a, ay - ny * a);
  pen.closePath();
}

// A faint disc about a joint, as wide as the joint may be off; none where it would not be seen.
const LEAST_HALO = 7; // px on the screen
export function drawHalo(pen, [x, y], radius, color) {
  if (!(radius > LEAST_HALO)) return;
  pen.save();
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = pen.strokeStyle = color;
  pen.globalAlpha = 0.16;
  pen.fill();
  pen.globalAlpha = 0.6;
  pen.lineWidth = 1;
  pen.stroke();
  pen.restore();
}

// style: {color, sign, alpha, dashed, tooLong, hovered}; sign as in `wedge`.
export function drawLimb(pen, from, to, style) {
  pen.save();
  pen.lineJoin = "round";
  pen.globalAlpha = style.alpha ?? 1;
  if (style.dashed) {
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.setLineDash([5, 5]);
    pen.strokeStyle = style.color;
    pen.lineWidth = 1.5;
    pen.stroke();
  } else {
    wedge(pen, from, to, style.sign);
    pen.strokeStyle = style.hovered ? "#fff" : CASING;
    pen.lineWidth = style.hovered ? 3 : 2;
    pen.stroke();
    pen.fillStyle = style.color;
    pen.fill();
  }
  if (style.tooLong) strikeThrough(pen, from, to);
  pen.restore();
}

// A limb that cannot be that long is struck through by a dashed white line.
function strikeThrough(pen, from, to) {
  pen.globalAlpha = 1;
  pen.beginPath();
  pen.moveTo(...from);
  pen.lineTo(...to);
  pen.strokeStyle = "#000";
  pen.lineWidth = 3;
  pen.stroke();
  pen.setLineDash([6, 5]);
  pen.strokeStyle = "#fff";
  pen.lineWidth = 2;
  pen.stroke();
}
