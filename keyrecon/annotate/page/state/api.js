// The server's answers. Everything but a clear answer counts as "the server is gone".

const RECONNECT_MS = 2000;

export class Gone extends Error {}

async function ask(path, options) {
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

export const read = (path) => ask(`/api/${path}`);
export const send = (path, content) => ask(`/api/${path}`, asJson("POST", content));
export const remove = (path) => ask(`/api/${path}`, { method: "DELETE" });

// Server-sent events; the browser connects again by itself unless it was refused.
export function listen(handlers) {
  const { opened, closed, news } = handlers,
    source = new EventSource("/api/events");
  source.addEventListener("open", opened);
  source.addEventListener("error", () => {
    closed();
    if (source.readyState === EventSource.CLOSED) setTimeout(listen, RECONNECT_MS, handlers);
  });
  source.addEventListener("message", (event) => news(JSON.parse(event.data)));
}

let keeping = 0; // requests that keep something, and have no answer yet
export const isKeeping = () => keeping > 0;

// Makes requests one after the other, in the order in which they are wanted. While one waits, answers to
// earlier ones are old: `take` gets the newest when nothing waits any more. `ask` gives a promise of when
// its request is done; `keep` asks, too, and is not saved until then. `failed` is told of each request
// without an answer.
export function oneByOne(take, failed) {
  let last = Promise.resolve(),
    waiting = 0,
    newest = null;
  async function work(request) {
    try {
      newest = { answer: await request() };
    } catch (fault) {
      failed(fault);
    }
    waiting -= 1;
    if (waiting || !newest) return;
    const { answer } = newest;
    newest = null;
    take(answer);
  }
  function inTurn(request) {
    waiting += 1;
    last = last.then(() => work(request));
    return last;
  }
  return {
    ask: inTurn,
    keep(request) {
      keeping += 1;
      return inTurn(() => request().finally(() => (keeping -= 1)));
    },
    rest: () => last,
  };
}

// Makes at most one request at a time; of those that wait only the newest is made. The promise is
// fulfilled when nothing waits any more; `failed` is called where the server answered with an error.
export function latestOnly(request, failed) {
  let waiting = null,
    working = null;
  async function work() {
    while (waiting) {
      const parameters = waiting;
      waiting = null;
      await request(...parameters).catch((fault) => {
        if (!(fault instanceof Gone)) failed(fault, ...parameters);
      });
    }
    working = null;
  }
  return (...parameters) => {
    waiting = parameters;
    working ??= work();
    return working;
  };
}
