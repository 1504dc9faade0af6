"""A relay between a client and a daemon that breaks connections on demand, or passes everything on late. It runs in a thread of its own."""
import asyncio
import threading

# Bytes of one read.
CHUNK = 1 << 16
# After a message passed, the other side gets this time to act on it before the connection breaks.
TIME_TO_ACT_S = 0.3


class _Connection:
    def __init__(self, relay, client, daemon):
        self.relay = relay
        self.client, self.daemon = client, daemon  # each a (reader, writer)
        self.deaf_to_daemon = self.deaf_to_client = False
        self.hurt = None  # what happens to the next bytes

    async def run(self):
        await asyncio.gather(self._copy(self.client[0], self.daemon[1], True), self._copy(self.daemon[0], self.client[1], False))

    async def _copy(self, source, sink, from_client):
        try:
            while data := await source.read(CHUNK):
                await self.relay.open_gate.wait()
                if from_client and self.hurt in ("lose request", "lose reply", "corrupt"):
                    data = self._hurt(data)
                if self.deaf_to_client if from_client else self.deaf_to_daemon:
                    continue
                if self.relay.delay_s > 0:
                    self.relay.later(self._write_unless_closing, sink, data)
                    continue
                sink.write(data)
                await sink.drain()
        except OSError:
            pass
        finally:
            self.relay.later(self.cut)

    @staticmethod
    def _write_unless_closing(sink, data):
        if not sink.transport.is_closing():
            sink.write(data)

    def _hurt(self, data):
        how, self.hurt = self.hurt, None
        if how == "corrupt":
            return bytes([data[0] ^ 0x5A]) + data[1:]
        self.deaf_to_daemon = True
        self.deaf_to_client = how == "lose request"
        asyncio.get_running_loop().call_later(TIME_TO_ACT_S if how == "lose reply" else 0.0, self.cut)
        return data

    def cut(self):
        """Resets both connections, so that neither side hears an orderly end."""
        for _, writer in (self.client, self.daemon):
            writer.transport.abort()
        self.relay.connections.discard(self)


class Relay:
    """Listens at `address` (a free port of the loopback interface) and passes on to `target`, which may be set anew at any time, what it gets, delay_s later in each
    direction."""

    def __init__(self, target, delay_s=0.0):
        self.target, self.delay_s = target, delay_s
        self.connections = set()
        self.accepted = 0
        self._loop = asyncio.new_event_loop()
        started = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(started,), name="relay", daemon=True)
        self._thread.start()
        started.wait()

    def _run(self, started):
        asyncio.set_event_loop(self._loop)
        self.open_gate = asyncio.Event()
        self.open_gate.set()
        self._server = self._loop.run_until_complete(asyncio.start_server(self._accept, "127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self._server.sockets[0].getsockname()[1]
        started.set()
        self._loop.run_forever()
        left = asyncio.all_tasks(self._loop)
        for task in left:
            task.cancel()
        self._loop.run_until_complete(asyncio.gather(*left, return_exceptions=True))
        self._loop.close()

    async def _accept(self, reader, writer):
        self.accepted += 1
        try:
            daemon = await asyncio.open_connection(*self.target.rsplit(":", 1))
        except OSError:
            writer.transport.abort()
            return
        connection = _Connection(self, (reader, writer), daemon)
        self.connections.add(connection)
        await connection.run()

    def later(self, function, *arguments):
        if self.delay_s > 0:
            self._loop.call_later(self.delay_s, function, *arguments)
        else:
            function(*arguments)

    def _call(self, function):
        done = threading.Event()

        def run():
            function()
            done.set()
        self._loop.call_soon_threadsafe(run)
        done.wait()

    def cut(self):
        """Breaks all connections now."""
        self._call(lambda: [connection.cut() for connection in list(self.connections)])

    def hurt_next(self, how):
        """lose request: the next bytes of each client are lost, and the connection breaks. lose reply: they arrive, but the daemon's answer is lost.
        corrupt: the frame that they begin with has a wrong length."""
        self._call(lambda: [setattr(connection, "hurt", how) for connection in list(self.connections)])

    def forget(self):
        """Passes nothing on in the connections that are open now, without closing them: the other end of a network that is gone."""
        def run():
            for connection in list(self.connections):
                connection.deaf_to_client = connection.deaf_to_daemon = True
        self._call(run)

    def hold(self):
        """Passes nothing on until `let_go`."""
        self._call(self.open_gate.clear)

    def let_go(self):
        self._call(self.open_gate.set)

    def close(self):
        self._call(self._server.close)
        self.cut()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()
