// What a person is told when something goes wrong, in one line.
import { Gone } from "./api.js";

const AGAIN = "What is marked is kept; if this happens again, load the page anew.";

// The server's words where it answered; what the page itself stumbled over is told as such.
export function describeFault(fault) {
  if (fault instanceof Gone || fault?.constructor === Error)
    return fault.message || "The server does not answer.";
  const [line] = String(fault?.message ?? fault).split("\n");
  return `That went wrong on the page (${line}). ${AGAIN}`;
}
