// The server's answers. Everything but a clear answer counts as "the server is gone".

const AGAIN = 2000; // ms

export class Gone extends Error {}

async function answered(path, options) {
  let response;
  try {
    response = await fetch(path, { credentials: "same-origin", cache: "no-store", ...options });
  } catch (fault) {
    throw new Gone("", { cause: fault });
  }
  const content = await response.json().catch(() => null);
  if (response.status >= 500 || response.status === 403) throw new Gone(content?.error ?? "");
  if (!response.ok) throw new Error(content?.error ?? `The server answered ${response.status}.`);
  return content;
}

const asJson = (method, content) => ({
  method,
  body: JSON.stringify(content),
  headers: { "Content-Type": "application/json" },
});

export const read = (path) => answered(`/api/${path}`);
export const send = (path, content) => answered(`/api/${path}`, asJson("POST", content));
export const remove = (path) => answered(`/api/${path}`, { method: "DELETE" });

// Server-sent events; the browser connects again by itself unless it was refused.
export function listen(hears) {
  const { opened, closed, news } = hears,
    source = new EventSource("/api/events");
  source.addEventListener("open", opened);
  source.addEventListener("error", () => {
    closed();
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, AGAIN, hears);
  });
  source.addEventListener("message", (event) => news(JSON.parse(event.data)));
}

// Asks at most one question at a time; of those that wait only the newest is asked. The promise is
// kept when nothing waits any more; `failed` hears what the server said instead of an answer.
export function latestOnly(ask, failed) {
  let waiting = null,
    asking = null;
  async function work() {
    while (waiting) {
      const question = waiting;
      waiting = null;
      await ask(...question).catch((fault) => {
        if (!(fault instanceof Gone)) failed(fault, ...question);
      });
    }
    asking = null;
  }
  return function request(...question) {
    waiting = question;
    asking ??= work();
    return asking;
  };
}
