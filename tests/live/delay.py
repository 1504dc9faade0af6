"""A relay between a client and a daemon that passes everything on late."""
import asyncio
import threading

CHUNK = 1 << 16


class DelayingRelay:
    """Listens at `address`, and passes on to `target` what it gets, delay_s later in each direction."""

    def __init__(self, target, delay_s):
        self.target, self.delay_s = target, delay_s
        self._loop, self._writers = asyncio.new_event_loop(), []
        started = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(started,), daemon=True)
        self._thread.start()
        started.wait()

    def _run(self, started):
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(asyncio.start_server(self._accept, "127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % server.sockets[0].getsockname()[1]
        started.set()
        self._loop.run_forever()
        server.close()
        for writer in self._writers:
            writer.transport.abort()
        left = asyncio.all_tasks(self._loop)
        for task in left:
            task.cancel()
        self._loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
        self._loop.close()

    async def _accept(self, reader, writer):
        far_reader, far_writer = await asyncio.open_connection(*self.target.rsplit(":", 1))
        self._writers += [writer, far_writer]
        await asyncio.gather(self._copy(reader, far_writer), self._copy(far_reader, writer))

    async def _copy(self, source, sink):
        try:
            while data := await source.read(CHUNK):
                self._loop.call_later(self.delay_s, sink.write, data)
        except OSError:
            pass
        self._loop.call_later(self.delay_s, sink.close)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
