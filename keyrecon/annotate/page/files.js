// Marks from and to other programs: what a file would change is shown before anything is changed.
import * as api from "./api.js";
import { byId, make } from "./dom.js";
import { spoken } from "./guide.js";

const FORMATS = [
  ["coco", "COCO keypoints", "annotations.json"],
  ["dlc", "DeepLabCut CSV", "CollectedData.csv"],
  ["cvat", "CVAT XML 1.1", "annotations.xml"],
];
const LISTED = 12; // conflicts shown one by one

export function createFiles(model) {
  const panel = byId("files-panel"),
    found = make("div", { className: "found" });
  const chosen = make("input", { type: "file", accept: ".json,.csv,.xml", id: "import-file" });

  async function look() {
    const [file] = chosen.files;
    if (!file) return;
    const content = { name: file.name, text: await file.text() };
    const answer = await api.send("import", { ...content, accept: false });
    const offer = (text, mode) => {
      const button = make("button", {}, text);
      button.addEventListener("click", () => take(content, mode));
      return button;
    };
    const { conflicts, frames } = answer,
      count = Array.isArray(frames) ? frames.length : frames;
    found.replaceChildren(
      make(
        "p",
        {},
        `${file.name}: ${count} frames, ${answer.new} new marks, ${conflicts.length} that differ from yours.`,
      ),
      make(
        "ul",
        {},
        ...conflicts
          .slice(0, LISTED)
          .map(({ frame, joint }) => make("li", {}, `frame ${frame}, ${spoken(joint)}`)),
        conflicts.length > LISTED ? make("li", {}, `and ${conflicts.length - LISTED} more`) : null,
      ),
      make(
        "p",
        { className: "choices" },
        offer(conflicts.length ? "Take it, keep mine where they differ" : "Take it", "keep"),
        conflicts.length ? offer("Take it, replace mine", "replace") : null,
      ),
    );
  }

  async function take(content, mode) {
    await api.send("import", { ...content, accept: true, mode });
    await model.readState();
    panel.close();
    model.tell("The marks were taken in; Undo takes them out again.");
  }

  const failing = (work) => () =>
    work().catch((fault) =>
      found.replaceChildren(make("p", { className: "wrong" }, fault.message)),
    );
  chosen.addEventListener("change", failing(look));
  panel.append(
    make(
      "form",
      { method: "dialog" },
      make("button", { className: "plain close", "aria-label": "Close" }, "✕"),
    ),
    make("h2", {}, "Take marks from a file"),
    make(
      "p",
      { className: "note" },
      "COCO keypoints, DeepLabCut CollectedData or CVAT XML; told by its content.",
    ),
    chosen,
    found,
    make("h2", {}, "Save marks for another program"),
    make(
      "p",
      { className: "choices" },
      ...FORMATS.map(([format, name, file]) =>
        make("a", { href: `/api/export/${format}`, download: file }, name),
      ),
    ),
    make(
      "p",
      { className: "note" },
      "annotations.json in the project folder is always a COCO file of what is marked now.",
    ),
  );
  byId("files").addEventListener("click", () => {
    found.replaceChildren();
    chosen.value = "";
    panel.showModal();
  });
}
