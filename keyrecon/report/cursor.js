// The page's one cursor, a frame number that everything shows, and what moves it.
import { unpack } from "./packed.js";
export const byId = (id) => document.getElementById(id);
export const read = (id) => JSON.parse(byId(id).textContent);
export const data = read("motion-data");
export const followers = []; // called with the frame number whenever it changes
export const restyled = []; // called when the colour scheme changes

const late = unpack(data.late).values; // seconds after those of an even frame rate
export const count = late.length;
export const cuts = new Set(data.cuts); // frames with which another shot begins
export const seconds = (number) => number / data.fps + late[number];

const slider = byId("frame"),
  play = byId("play"),
  output = byId("now"),
  speed = byId("speed"),
  clip = byId("clip");
slider.max = count - 1;
let now = 0,
  playing = false,
  started = 0,
  from = 0;
export const frame = () => now;

function startClock() {
  from = now;
  started = performance.now();
}

export function show(number, seek = true) {
  now = Math.max(0, Math.min(count - 1, Math.round(number)));
  slider.value = now;
  output.textContent = `frame ${now}, ${seconds(now).toFixed(2)} s`;
  if (seek) {
    if (clip.readyState) clip.currentTime = (now + 0.5) / data.fps;
    startClock();
  }
  followers.forEach((draw) => draw(now));
}

// The small video leads where the browser plays it, else a clock does.
function step() {
  if (!playing) return;
  const led = clip.readyState > 2 && !clip.paused;
  const due = led
    ? Math.floor(clip.currentTime * data.fps + 1e-3)
    : from + ((performance.now() - started) / 1000) * data.fps * Number(speed.value);
  if (due >= count - 1 || clip.ended) {
    show(count - 1, false);
    setPlaying(false);
    return;
  }
  if (Math.floor(due) !== now) show(Math.floor(due), false);
  requestAnimationFrame(step);
}

function setPlaying(wanted) {
  playing = wanted;
  play.textContent = playing ? "❚❚" : "▶";
  play.setAttribute("aria-label", playing ? "Pause" : "Play");
  if (!playing) {
    clip.pause();
    show(now);
    return;
  }
  show(now >= count - 1 ? 0 : now);
  clip.playbackRate = Number(speed.value);
  clip.play().catch(() => {}); // without the video the clock goes on
  requestAnimationFrame(step);
}

play.addEventListener("click", () => setPlaying(!playing));
slider.addEventListener("input", () => {
  if (playing) setPlaying(false);
  show(Number(slider.value));
});
speed.addEventListener("change", () => {
  clip.playbackRate = Number(speed.value);
  startClock();
});
clip.addEventListener("loadedmetadata", () => show(now));
document.addEventListener("keydown", (event) => {
  const busy = event.target.closest("select, input, button, summary, dialog[open]");
  if ((busy && event.target !== slider) || event.ctrlKey || event.metaKey || event.altKey) return;
  const steps = { ArrowLeft: -1, ArrowRight: 1 };
  if (event.key === " ") setPlaying(!playing);
  else if (event.key in steps) show(now + steps[event.key] * (event.shiftKey ? 10 : 1));
  else return;
  event.preventDefault();
});

const large = byId("large");
function enlarge(card) {
  show(Number(card.dataset.frame));
  const image = card.querySelector("img");
  if (!image) return;
  large.querySelector("img").src = image.src;
  large.querySelector("img").alt = image.alt;
  large.querySelector("p").textContent = image.alt;
  large.showModal();
}
for (const card of document.querySelectorAll(".still"))
  card.addEventListener("click", () => enlarge(card));
large.addEventListener("click", () => large.close());
for (const line of document.querySelectorAll(".goes"))
  line.addEventListener("click", () => {
    show(Number(line.dataset.frame));
    byId("figure").scrollIntoView({ block: "center" });
  });
for (const image of document.querySelectorAll("[data-copy]"))
  image.src = byId(image.dataset.copy).src;

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  restyled.forEach((restyle) => restyle());
});
addEventListener("DOMContentLoaded", () => show(data.first));
