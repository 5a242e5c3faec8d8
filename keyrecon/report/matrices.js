// Distance matrices: grey pictures in colour, with the keyframes, the cursor and a readout.
import { frame, show, followers } from "./cursor.js";

const STEPS = ["#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74",
  "#c3b369", "#e1cc55", "#fee838"].map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)));

const TOP = 254, UNKNOWN = 255; // grey values: the largest distance, and none
const NOT_COMPARED = [255, 255, 255];

// Cividis, even in lightness also for the colour-blind (Nunez, Anderton and Renslow 2018).
function cividis(share) {
  const at = Math.min(share, 0.9999) * (STEPS.length - 1), low = Math.floor(at);
  return STEPS[low].map((value, n) => value + (STEPS[low + 1][n] - value) * (at - low));
}

// The picture in colour; returns its canvas and the grey values.
function colored(image) {
  const side = image.naturalWidth, canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0);
  const pixels = pen.getImageData(0, 0, side, side);
  const lookup = Array.from({ length: 256 }, (_, n) => (n === UNKNOWN ? NOT_COMPARED : cividis(n / TOP)));
  const grey = Uint8Array.from({ length: side * side }, (_, n) => pixels.data[4 * n]);
  grey.forEach((value, n) => pixels.data.set(lookup[value], 4 * n));
  pen.putImageData(pixels, 0, 0);
  return { canvas, grey, side };
}

function setUp(figure) {
  const { top, beta, frames, keyframes } = JSON.parse(figure.dataset.matrix);
  const plate = figure.querySelector(".plate"), readout = figure.querySelector("output");
  const { canvas, grey, side } = colored(figure.querySelector("img"));
  const over = document.createElement("canvas"), brush = over.getContext("2d");
  over.width = over.height = 720;
  plate.append(canvas, over);
  figure.insertBefore(scale(top, beta), readout);
  const unit = over.width / frames;
  let pointed = null;

  function cross(across, down, style) {
    const [x, y] = [(across + 0.5) * unit, (down + 0.5) * unit];
    brush.strokeStyle = style;
    brush.beginPath();
    brush.moveTo(x, 0); brush.lineTo(x, over.width);
    brush.moveTo(0, y); brush.lineTo(over.width, y);
    brush.stroke();
  }

  function mark() {
    brush.clearRect(0, 0, over.width, over.width);
    brush.fillStyle = "#ffffff";
    for (const keyframe of keyframes) {
      const at = (keyframe + 0.5) * unit;
      brush.beginPath();
      brush.moveTo(at - 6, 0); brush.lineTo(at + 6, 0); brush.lineTo(at, 10);
      brush.moveTo(0, at - 6); brush.lineTo(0, at + 6); brush.lineTo(10, at);
      brush.fill();
    }
    cross(frame(), frame(), "#ffffffcc");
    if (pointed) cross(...pointed, "#ff6ec7");
  }

  function pairAt(event) {
    const box = over.getBoundingClientRect();
    const at = [event.clientX - box.left, event.clientY - box.top];
    return at.map((p) => Math.max(0, Math.min(frames - 1, Math.floor((p / box.width) * frames))));
  }

  over.addEventListener("pointermove", (event) => {
    pointed = pairAt(event);
    const [column, row] = pointed.map((at) => Math.min(side - 1, Math.floor((at / frames) * side)));
    const value = grey[row * side + column], distance = (value / TOP) * top;
    const told = value === UNKNOWN ? "not compared"
      : `${value === TOP ? "at least " : ""}${distance.toFixed(3)} player heights`
        + (distance < beta ? ", alike" : "");
    readout.textContent = `frames ${pointed[1]} and ${pointed[0]}: ${told}`;
    mark();
  });
  over.addEventListener("pointerleave", () => {
    pointed = null;
    readout.textContent = "\u00a0";
    mark();
  });
  over.addEventListener("click", (event) => show(pairAt(event)[1]));
  followers.push(mark);
  mark();
}

// The colours with their distances, and beta on them.
function scale(top, beta) {
  const bar = document.createElement("div"), tick = document.createElement("i");
  bar.className = "scale";
  const stops = [0, 0.25, 0.5, 0.75, 1].map((share) => `rgb(${cividis(share).map(Math.round)})`);
  bar.style.background = `linear-gradient(to right, ${stops})`;
  const at = Math.min(1, beta / top) * 100;
  for (const [place, label] of [[0, "0"], [at, "β"], [100, top.toFixed(2)]]) {
    const span = document.createElement("span");
    span.textContent = label;
    span.style.left = `${place}%`;
    bar.append(span);
  }
  tick.style.left = `${at}%`;
  bar.append(tick);
  return bar;
}

for (const figure of document.querySelectorAll(".matrix")) {
  figure.querySelector("img").decode().then(() => setUp(figure));
}
