// The shots of a video as a strip of pictures: a click says whether one shows the player. It is kept, and
// known when the keyframes are chosen next.
import * as api from "../state/api.js";
import { byId, make, setText, toggle } from "./dom.js";

const WIDTH = 160; // of a picture, px
const MOST_NAMED = 8;

export function createShots(model, { address, show, isBusy }) {
  const strip = byId("shots");

  const take = (shots) => {
    model.project = { ...model.project, shots };
    model.redraw();
  };
  const requests = api.oneByOne(take, (fault) => model.notify(fault.message || "The server does not answer."));

  // A choice shows at once, and is taken back where it was not kept.
  function choose({ number, wanted }) {
    const before = model.project.shots,
      used = !wanted;
    take(before.map((shot) => (shot.number === number ? { ...shot, wanted: used } : shot)));
    requests.keep(() =>
      api.send("shots", { number, used }).catch((fault) => {
        take(before);
        throw fault;
      }),
    );
  }

  function tile(shot) {
    const middle = Math.round((shot.first + shot.last) / 2);
    const picture = make("img", { alt: "", loading: "lazy", src: address(middle, WIDTH) });
    const words = `${shot.number} · ${shot.first}-${shot.last}`;
    const button = make("button", { className: "shot" }, picture, make("b", {}, words), make("small", {}, saying(shot)));
    button.setAttribute("aria-pressed", shot.wanted);
    toggle(button, "unsure", shot.unsure);
    button.title = shot.wanted ? "Leave this shot out" : "Use this shot";
    button.addEventListener("click", () => {
      show(middle);
      if (!isBusy()) choose(shot);
    });
    return button;
  }

  function saying({ shows, used, wanted }) {
    if (used === wanted) return used ? "used" : shows;
    return wanted ? "to be used" : "to be left out";
  }

  function draw() {
    const shots = model.project.shots ?? [],
      content = JSON.stringify(shots);
    byId("shots-row").hidden = !shots.length;
    if (strip.dataset.content === content) return;
    strip.dataset.content = content;
    strip.replaceChildren(...shots.map(tile));
    setText(byId("shots-note"), note(shots));
  }

  function note(shots) {
    if (shots.some(({ used, wanted }) => used !== wanted)) return "Choose the keyframes again, and they know this.";
    const unsure = shots.filter((shot) => shot.unsure).map(({ number }) => number);
    if (unsure.length)
      return `Is this the player? Click it if so: shot ${unsure.slice(0, MOST_NAMED).join(", ")}${unsure.length > MOST_NAMED ? " ..." : ""}.`;
    return "Click a shot that shows the player and is not used, or one that is used and does not.";
  }

  return { draw };
}
