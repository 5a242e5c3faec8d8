"""Where the page is served: a listening socket, the names it answers to, and the last address.

The port and the cookie's secret are kept in the project's cache, readable by nobody else, so
that a page that is still open goes on by itself when the server is started again.
"""

import json
import os
import socket
from contextlib import suppress
from dataclasses import dataclass, replace
from ipaddress import ip_address
from pathlib import Path

from keyrecon.annotate.server.security import Credentials
from keyrecon.errors import KeyreconError
from keyrecon.io.durable import write_durably
from keyrecon.reading import parse_json, read_text

SECRET_LENGTH = 40
LAST_PORT = 65_535
"""Secrets shorter than this were not made here."""


@dataclass(frozen=True)
class LastAddress:
    """Where the page of a project was served last, and what its cookie held."""

    port: int = 0
    cookie_secret: str | None = None


def recall(file: Path) -> LastAddress:
    """What `remember` wrote; nothing where the file is not there or damaged."""
    try:
        noted = parse_json(read_text(file))
        port, secret = int(noted["port"]), str(noted["session"])
    except (OSError, ValueError, LookupError, TypeError):
        return LastAddress()
    known = 1024 <= port <= 65535 and len(secret) >= SECRET_LENGTH
    return LastAddress(port, secret) if known else LastAddress()


def remember(file: Path, credentials: Credentials) -> None:
    """Note the address for the next start; nobody else may read it."""
    file.parent.mkdir(exist_ok=True)
    file.touch(0o600)
    noted = {"port": credentials.port, "session": credentials.cookie_secret}
    write_durably(file, json.dumps(noted))


def listen(host: str, port: int, memory: LastAddress = LastAddress()) -> socket.socket:
    """A listening socket; KeyreconError where the port is taken, or there is no such port.

    Without a port the last one is used again if it is free.
    """
    if not 0 <= port <= LAST_PORT:
        raise KeyreconError(
            f"--port cannot be {port}; it is a whole number from 1 to {LAST_PORT}, or none for any "
            "that is free."
        )
    if not port and memory.port:
        with suppress(KeyreconError):
            return _bind(host, memory.port)
    return _bind(host, port)


def _bind(host: str, port: int) -> socket.socket:
    """Made for TCP by name: only then are small answers sent at once (asyncio sets TCP_NODELAY)."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    if os.name == "posix":  # elsewhere it would let others take the port
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()  # from now on a browser waits instead of being turned away
    except (OSError, OverflowError) as fault:
        listener.close()
        raise KeyreconError(
            f"Nothing can be served at {host} port {port} ({getattr(fault, 'strerror', fault)}); "
            "choose another --port, or none for any that is free."
        ) from fault
    return listener


def make_credentials(
    listener: socket.socket, host: str, memory: LastAddress = LastAddress()
) -> Credentials:
    """The fixed list of names under which the server answers, and its secrets.

    Names are in small letters, as a browser sends them however they were typed.
    """
    port = listener.getsockname()[1]
    names = (name.lower() for name in _host_names(host))
    credentials = Credentials(tuple(f"{name}:{port}" for name in names), port)
    if memory.cookie_secret is None:
        return credentials
    return replace(credentials, cookie_secret=memory.cookie_secret)


def _host_names(host: str) -> tuple[str, ...]:
    """How a browser may write an address, best first."""
    if host in ("0.0.0.0", "::"):
        name = socket.gethostname()
        return (name, *_addresses(name), "127.0.0.1", "localhost")
    if is_loopback(host):
        return (f"[{host}]" if ":" in host else host, "localhost")
    return (f"[{host}]" if ":" in host else host,)


def _addresses(name: str) -> tuple[str, ...]:
    """This machine's own addresses, as far as it knows them by name."""
    try:
        return tuple(socket.gethostbyname_ex(name)[2])
    except OSError:
        return ()


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach an address."""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False
