// Long work on the server: starting it, and what its end means for the page.
import * as api from "./api.js";

export function createJobs(model) {
  const seen = new Map(); // job -> last state that was acted on

  async function start(kind, options = {}) {
    try {
      await api.send("jobs", { kind, options });
      await refresh();
    } catch (fault) {
      model.tell(
        fault instanceof api.Gone
          ? "The server does not answer; is keyrecon annotate still running?"
          : fault.message,
      );
    }
  }

  async function refresh() {
    for (const job of await api.read("jobs")) model.jobs.set(job.id, job);
    model.changed();
  }

  function ended(job) {
    if (job.state === "failed") model.tell(job.text || "The work failed.");
    if (job.state === "cancelled")
      model.tell("Cancelled. What was finished is kept; starting again goes on from there.");
    if (job.state !== "done") return;
    model.readProject().then(() => {
      if (job.kind === "keyframes") model.do({ view: "keyframes" });
      if (job.kind === "run") model.do({ view: "motion", motion: null });
    });
  }

  // Ends that happened before the page was opened are no news.
  function draw() {
    for (const job of model.jobs.values()) {
      if (seen.get(job.id) === "running" && job.state !== "running") ended(job);
      seen.set(job.id, job.state);
    }
  }

  return { start, refresh, draw };
}
