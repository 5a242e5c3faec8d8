"""News for all open pages, as server-sent events: accepted edits and the progress of jobs."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Any

Json = dict[str, Any]
HEARTBEAT_SECONDS = 10.0
"""A comment is sent this often, so that either side notices when the other is gone."""


class Events:
    """Sends every piece of news to every open page."""

    def __init__(self) -> None:
        """Begin without pages."""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._queues: set[asyncio.Queue[Json | None]] = set()

    def publish(self, news: Json) -> None:
        """Send news, from any thread."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._put, news)

    def _put(self, news: Json | None) -> None:
        for queue in self._queues:
            queue.put_nowait(news)

    def close(self) -> None:
        """End all streams; called in the server's own thread."""
        self._put(None)

    async def stream(self, first: Callable[[], Json]) -> AsyncIterator[str]:
        """The text of an event stream; `first` is for the new page itself, and made when no news
        can be missed any more."""
        self._loop = asyncio.get_running_loop()
        queue: asyncio.Queue[Json | None] = asyncio.Queue()
        self._queues.add(queue)
        try:
            news: Json | None = first()
            while news is not None:
                yield f"data: {json.dumps(news)}\n\n"
                news = await self._next(queue)
                while news == {}:
                    yield ": still here\n\n"
                    news = await self._next(queue)
        finally:
            self._queues.discard(queue)

    async def _next(self, queue: asyncio.Queue[Json | None]) -> Json | None:
        """The next news, None at the end, {} when there was none for a while."""
        with suppress(TimeoutError):
            return await asyncio.wait_for(queue.get(), HEARTBEAT_SECONDS)
        return {}
