// Marks from and to other programs: what a file would change is shown before anything is changed.
import * as api from "../state/api.js";
import { byId, make } from "./dom.js";
import { label } from "../state/workflow.js";

const FORMATS = [
  ["coco", "COCO keypoints", "annotations.json"],
  ["dlc", "DeepLabCut CSV", "CollectedData.csv"],
  ["cvat", "CVAT XML 1.1", "annotations.xml"],
];
const MAX_LISTED = 12; // conflicts shown one by one

export function createFiles(model) {
  const comparison = make("div");
  const chosen = make("input", { type: "file", accept: ".json,.csv,.xml", id: "import-file" });

  async function compare() {
    const [file] = chosen.files;
    if (!file) return;
    const content = { name: file.name, text: await file.text() };
    const answer = await api.send("import", { ...content, accept: false });
    const offer = (text, mode) => {
      const button = make("button", {}, text);
      button.addEventListener("click", failing(() => accept(content, mode)));
      return button;
    };
    const { conflicts, frames } = answer,
      count = Array.isArray(frames) ? frames.length : frames;
    comparison.replaceChildren(
      make(
        "p",
        {},
        `${file.name}: ${count} frames, ${answer.new} new marks, ${conflicts.length} that differ from yours.`,
      ),
      make(
        "ul",
        {},
        ...conflicts
          .slice(0, MAX_LISTED)
          .map(({ frame, joint }) => make("li", {}, `frame ${frame}, ${label(joint)}`)),
        conflicts.length > MAX_LISTED ? make("li", {}, `and ${conflicts.length - MAX_LISTED} more`) : null,
      ),
      make(
        "p",
        { className: "choices" },
        offer(conflicts.length ? "Take it, keep mine where they differ" : "Take it", "keep"),
        conflicts.length ? offer("Take it, replace mine", "replace") : null,
      ),
    );
  }

  async function accept(content, mode) {
    await api.send("import", { ...content, accept: true, mode });
    await model.readState();
    await model.readProject(); // it lists frames that bear marks
    comparison.replaceChildren();
    chosen.value = "";
    model.notifyOfEdit("The marks were taken in; Undo takes them out again.");
  }

  const failing = (work) => () =>
    work().catch((fault) =>
      comparison.replaceChildren(make("p", { className: "wrong" }, fault.message)),
    );
  chosen.addEventListener("change", failing(compare));
  byId("marks-files").append(
    make("h2", {}, "Take marks from a file"),
    make(
      "p",
      { className: "note" },
      "COCO keypoints, DeepLabCut CollectedData or CVAT XML; the kind is recognised by the content.",
    ),
    chosen,
    comparison,
    make("h2", {}, "Save marks for another program"),
    make(
      "p",
      { className: "choices" },
      ...FORMATS.map(([format, name, file]) =>
        make("a", { href: `/api/export/${format}`, download: file, className: "button" }, name),
      ),
    ),
    make(
      "p",
      { className: "note" },
      "annotations.json in the project folder is always a COCO file of what is marked now.",
    ),
  );
}
