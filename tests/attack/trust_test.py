"""Who may speak: trust_test.py SIGHTLINED STUBS [CLASS.METHOD...]. Certificates come from the command openssl, clients from gRPC and from Python's ssl."""
import contextlib
import os
import pathlib
import signal
import socket
import ssl
import struct
import subprocess
import sys
import tempfile
import time
import unittest

os.environ.setdefault("GRPC_VERBOSITY", "NONE")  # refused handshakes are expected here
import daemon as attack  # noqa: E402

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path[:0] = [STUBS, str(pathlib.Path(__file__).parents[1] / "metrics")]

import grpc  # noqa: E402
from sightline.v1 import camera_control_pb2, server_pb2, session_pb2  # noqa: E402
from sightline.v1.scene_pb2 import SceneRef, Target  # noqa: E402

from certificates import Authority  # noqa: E402
from daemon import Daemon  # noqa: E402
from exposition import scrape, value  # noqa: E402
from service_stub import CameraControlServiceStub  # noqa: E402
from sessions import Session, boxes  # noqa: E402
from sightline.v1.camera_pb2 import Pose3, Vec3  # noqa: E402

GAME, OTHER, BOARD, ROOT = (f"{name}-0123456789abcdef" for name in ("game", "other", "board", "root"))
ACCESS = f"""
token game control {GAME}
token other control {OTHER}
token board observe {BOARD}
token root admin {ROOT}
certificate spiffe://example/game control
"""
UNAUTHENTICATED, DENIED = grpc.StatusCode.UNAUTHENTICATED, grpc.StatusCode.PERMISSION_DENIED


class Files:
    """An authority, the daemon's certificate and an access file, in a folder that the daemon reads."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.authority = Authority(folder)
        self.certificate, self.key = self.folder / "tls.pem", self.folder / "tls.key"
        self.access = self.folder / "access"
        self.access.write_text(ACCESS)
        self.use(*self.authority.sign("first"))

    def use(self, certificate, key):
        self.certificate.write_bytes(certificate.read_bytes())
        self.key.write_bytes(key.read_bytes())

    @property
    def tls(self):
        return ["--tls-cert", str(self.certificate), "--tls-key", str(self.key)]

    @property
    def all(self):
        return [*self.tls, "--access-file", str(self.access)]


def call_credentials(token):
    return [("authorization", "Bearer " + token)] if token else []


class Client:
    """The stub and the channel of a client with these credentials."""

    def __init__(self, address, files=None, token=None, certificate=None):
        options = [("grpc.use_local_subchannel_pool", 1)]
        if files is None:
            self.channel = grpc.insecure_channel(address, options)
        else:
            pair = [path.read_bytes() for path in reversed(certificate)] if certificate else [None, None]
            self.channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(files.authority.certificate.read_bytes(), *pair), options)
        if token:
            self.channel = grpc.intercept_channel(self.channel, Bearer(token))
        self.stub = CameraControlServiceStub(self.channel)

    def info(self):
        return self.stub.GetServerInfo(server_pb2.GetServerInfoRequest(), timeout=5)

    def stats(self):
        return self.stub.GetServerStats(server_pb2.GetServerStatsRequest(), timeout=5)

    def sessions(self):
        return self.stub.ListSessions(server_pb2.ListSessionsRequest(), timeout=5).sessions

    def reflection(self, version):
        """The list of services, as bytes."""
        method = f"/grpc.reflection.{version}.ServerReflection/ServerReflectionInfo"
        return next(self.channel.stream_stream(method)(iter([b"\x3a\x01*"]), timeout=5))

    def upload(self, data):
        return self.stub.UploadScene(iter([camera_control_pb2.UploadSceneRequest(chunk=data)]), timeout=10).hash

    def session(self, **more):
        request = session_pb2.OpenSession(camera=Pose3(position=Vec3(y=1.6, z=6)), targets=[Target(id=1)], **more)
        request.instances.extend(boxes(1))
        return Session(None, request, channel=self.channel)

    def resume(self, opened, answered):
        return Session(None, session_pb2.ResumeSession(token=opened.resume_token, answered_sequence=answered), channel=self.channel)


class Bearer(grpc.UnaryUnaryClientInterceptor, grpc.StreamStreamClientInterceptor, grpc.StreamUnaryClientInterceptor):
    def __init__(self, token):
        self.token = token

    def _with(self, details):
        return details._replace(metadata=[*(details.metadata or []), *call_credentials(self.token)])

    def intercept_unary_unary(self, continuation, details, request):
        return continuation(self._with(details), request)

    intercept_stream_stream = intercept_stream_unary = intercept_unary_unary


def wait_for(condition, seconds=10):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError("it did not happen")
        time.sleep(0.02)


def glb():
    import json
    text = json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                       "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
                       "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
                       "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36}]}).encode()
    text += b" " * (-len(text) % 4)
    data = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    return (struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)) + struct.pack("<I4s", len(text), b"JSON") + text +
            struct.pack("<I4s", len(data), b"BIN\0") + data)


class Case(unittest.TestCase):
    def setUp(self):
        self.files = Files(self.enterContext(tempfile.TemporaryDirectory()))

    def enterContext(self, context):
        value = context.__enter__()
        self.addCleanup(context.__exit__, None, None, None)
        return value

    def daemon(self, *arguments, **more):
        return self.enterContext(Daemon(*arguments, **more))

    def refused(self, code, call):
        with self.assertRaises(grpc.RpcError) as caught:
            call()
        self.assertEqual(caught.exception.code(), code, caught.exception.details())
        return caught.exception.details()


class Addresses(Case):
    """Nobody opens a daemon to a network without noticing."""

    def start(self, *arguments):
        result = subprocess.run([Daemon.path, "--sampler", "embree", *arguments], capture_output=True, text=True, timeout=20)
        return result.returncode, result.stderr

    def test_an_address_beyond_the_host_needs_callers_that_are_known(self):
        for address in ("0.0.0.0:0", "[::]:0"):
            for trust in ([], self.files.tls):
                with self.subTest(address=address, trust=trust):
                    code, log = self.start("--listen", address, *trust)
                    self.assertEqual(code, 1)
                    self.assertIn("--allow-insecure-network", log)
        for trust in (["--allow-insecure-network"], self.files.all, [*self.files.tls, "--tls-client-ca", str(self.files.authority.certificate)]):
            with self.subTest(trust=trust):
                self.daemon(*trust, listen=("--listen", "0.0.0.0:0"))

    def test_flags_that_are_wrong_together_are_named(self):
        for wrong, flag in ((["--tls-cert", "x"], "--tls-cert"), (["--tls-key", "x"], "--tls-key"), (["--tls-client-ca", "x"], "--tls-client-ca"),
                            (["--access-file", str(self.files.access)], "--access-file")):
            code, text = self.start(*wrong)
            self.assertEqual((code, flag in text), (2, True), text)

    def test_files_that_cannot_be_used_stop_the_start(self):
        other = self.files.authority.sign("other")
        expired = self.files.authority.sign("expired", days=-1)
        broken = self.files.folder / "broken"
        broken.write_text("nothing")
        for trust, reason in ((["--tls-cert", str(self.files.certificate), "--tls-key", str(other[1])], "does not belong"),
                              (["--tls-cert", str(broken), "--tls-key", str(other[1])], "no certificate"),
                              (["--tls-cert", str(expired[0]), "--tls-key", str(expired[1])], "expired"),
                              (["--tls-cert", "/nowhere", "--tls-key", str(other[1])], "No such file"),
                              ([*self.files.tls, "--tls-client-ca", str(broken)], "no certificate"),
                              ([*self.files.tls, "--access-file", str(broken)], "line 1")):
            with self.subTest(reason=reason):
                code, log = self.start(*trust, "--listen", "127.0.0.1:0")
                self.assertEqual(code, 1)
                self.assertIn(reason, log)


class Tokens(Case):
    def test_each_role_may_make_its_calls(self):
        address = self.daemon(*self.files.all).address
        game, board, root = (Client(address, self.files, token) for token in (GAME, BOARD, ROOT))
        for client in (game, board, root):
            self.assertTrue(client.info().version)
            for version in ("v1", "v1alpha"):
                self.assertIn(b"CameraControlService", client.reflection(version))
        for client in (game, root):
            with client.session() as session:
                self.assertEqual(session.tick().sequence, 1)
                told = board.sessions()
                self.assertEqual([(row.client, row.steps) for row in told], [("token game" if client is game else "token root", 1)])
            client.upload(glb())
        for client in (board, root):
            wait_for(lambda: client.stats().open_sessions == 0)
            self.assertEqual(len(client.sessions()), 0)
        self.refused(DENIED, board.session)
        self.refused(DENIED, lambda: board.upload(glb()))
        self.refused(DENIED, game.stats)
        self.refused(DENIED, game.sessions)

    def test_a_caller_without_a_valid_token_may_do_nothing(self):
        address = self.daemon(*self.files.all).address
        for token in (None, "", GAME[:-1], GAME + "x", GAME.upper()):
            client = Client(address, self.files, token)
            for call in (client.info, client.stats, client.sessions, client.session, lambda: client.upload(glb())):
                self.refused(UNAUTHENTICATED, call)
            for version in ("v1", "v1alpha"):
                self.refused(UNAUTHENTICATED, lambda: client.reflection(version))
        self.assertEqual(Client(address, self.files, ROOT).stats().access.refused_calls, 35)

    def test_a_unix_socket_knows_its_users_and_takes_tokens(self):
        path = str(self.files.folder / "socket")
        listen = ("--listen", "none", "--listen-unix", path)
        address = self.daemon("--access-file", str(self.files.access), listen=listen).address
        self.refused(UNAUTHENTICATED, Client(address).info)
        self.assertTrue(Client(address, token=GAME).info().version)
        self.files.access.write_text(f"user {os.getuid()} observe\n")
        address = self.daemon("--access-file", str(self.files.access), listen=("--listen", "none", "--listen-unix", path + "2")).address
        self.assertTrue(Client(address).stats().access)
        self.refused(DENIED, Client(address).session)

    def test_one_token_cannot_use_up_the_sessions_of_another(self):
        address = self.daemon(*self.files.all, "--max-sessions-per-client", "1").address
        with Client(address, self.files, GAME).session():
            self.assertIn("--max-sessions-per-client", self.refused(grpc.StatusCode.RESOURCE_EXHAUSTED, Client(address, self.files, GAME).session))
            with Client(address, self.files, OTHER).session() as session:
                self.assertEqual(session.tick().sequence, 1)

    def test_an_upload_is_its_owners(self):
        address = self.daemon(*self.files.all).address
        game, other, root = (Client(address, self.files, token) for token in (GAME, OTHER, ROOT))
        scene = SceneRef(hash=game.upload(glb()))
        for client in (game, root):
            client.session(scene=scene).close()
        self.assertIn("no scene with the hash", self.refused(grpc.StatusCode.NOT_FOUND, lambda: other.session(scene=scene)))
        other.upload(glb())
        other.session(scene=scene).close()

    def test_a_session_is_resumed_by_its_owner_only(self):
        address = self.daemon(*self.files.all).address
        game, other, root, board = (Client(address, self.files, token) for token in (GAME, OTHER, ROOT, BOARD))
        session = game.session(resumable=True)
        self.assertEqual(session.tick().sequence, 1)
        session.breaks()
        wait_for(lambda: root.stats().kept_sessions == 1)
        for thief in (other, root):
            self.assertIn("no session of this client", self.refused(grpc.StatusCode.NOT_FOUND, lambda: thief.resume(session.opened, 1)))
        self.refused(DENIED, lambda: board.resume(session.opened, 1))
        self.refused(UNAUTHENTICATED, lambda: Client(address, self.files).resume(session.opened, 1))
        stats = root.stats()
        self.assertEqual((stats.kept_sessions, stats.refused_resumes, stats.resumed_sessions), (1, 2, 0))
        # Another connection of the owner.
        with Client(address, self.files, GAME).resume(session.opened, 1) as again:
            self.assertTrue(again.opened.resumed)
            again.sequence = 1
            self.assertEqual(again.tick().sequence, 2)

    def test_a_token_that_is_taken_away_ends_its_sessions(self):
        daemon = self.daemon(*self.files.all)
        game, other = (Client(daemon.address, self.files, token).session() for token in (GAME, OTHER))
        self.files.access.write_text(ACCESS.replace("token game", "token renamed"))
        daemon.process.send_signal(signal.SIGHUP)
        self.assertEqual(game.status().code(), UNAUTHENTICATED)
        self.assertEqual(other.tick().sequence, 1)

    def test_a_broken_access_file_changes_nothing(self):
        daemon = self.daemon(*self.files.all, "--metrics-listen", "127.0.0.1:0")
        self.files.access.write_text("token game\n")
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_log("credentials refused")
        daemon.wait_for_log("line 1")
        self.assertTrue(Client(daemon.address, self.files, GAME).info().version)
        access = Client(daemon.address, self.files, ROOT).stats().access
        self.assertEqual((access.files_refused, access.files_taken_over), (1, 0))
        families = scrape(operators(daemon))
        self.assertEqual(value(families, "sightline_credentials_current", file="access"), 0)
        self.assertEqual(value(families, "sightline_credential_changes_total", file="access", outcome="refused"), 1)
        with self.assertRaises(grpc.RpcError):
            Client(daemon.address, self.files, "unknown" * 4).info()
        self.assertEqual(value(scrape(operators(daemon)), "sightline_calls_refused_total"), 1)


def served_certificate(address, files, **more):
    """The certificate that the daemon shows, after a handshake by Python's ssl."""
    context = ssl.create_default_context(cafile=files.authority.certificate)
    context.set_alpn_protocols(more.pop("alpn", ["h2"]))
    for name, value in more.items():
        setattr(context, name, value)
    host, port = address.rsplit(":", 1)
    with socket.create_connection((host, int(port)), 5) as plain, context.wrap_socket(plain, server_hostname=host) as connection:
        # With TLS 1.3 a refusal comes after the client's last message.
        connection.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + attack.frame(attack.SETTINGS, 0, 0))
        if not connection.recv(1):
            raise ConnectionError("closed")
        return connection.getpeercert()["serialNumber"]


def operators(daemon):
    daemon.wait_for_log("metrics=")
    return daemon.log().split("metrics=")[1].split()[0]


class Certificates(Case):
    def test_a_new_pair_is_taken_over_and_a_broken_one_is_not(self):
        daemon = self.daemon(*self.files.all, "--metrics-listen", "127.0.0.1:0")

        def told(file="certificate"):
            families = scrape(operators(daemon))
            changes = [value(families, "sightline_credential_changes_total", file=file, outcome=outcome) for outcome in ("refused", "taken_over")]
            return (*changes, value(families, "sightline_credentials_current", file=file))
        self.assertEqual(told(), (0, 0, 1))
        first = served_certificate(daemon.address, self.files)
        session = Client(daemon.address, self.files, GAME).session()
        second = self.files.authority.sign("second")
        self.files.certificate.write_bytes(second[0].read_bytes())  # the key is still the first one's
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_log("the key does not belong to the certificate")
        self.assertEqual(served_certificate(daemon.address, self.files), first)
        self.assertEqual(told(), (1, 0, 0))
        self.files.use(*second)
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_log("credentials taken over")
        self.assertNotEqual(served_certificate(daemon.address, self.files), first)
        self.assertEqual((told(), told("access")), ((1, 1, 1), (0, 0, 1)))
        expiry = value(scrape(operators(daemon)), "sightline_certificate_expiry_timestamp_seconds")
        self.assertAlmostEqual(expiry, time.time() + 2 * 86400, delta=600)
        self.assertEqual(session.tick().sequence, 1, "an open session stays")
        access = Client(daemon.address, self.files, ROOT).stats().access
        self.assertEqual((access.files_refused, access.files_taken_over), (1, 1))

    def test_clients_must_show_a_certificate_of_the_authority(self):
        daemon = self.daemon(*self.files.all, "--tls-client-ca", str(self.files.authority.certificate))
        game = self.files.authority.sign("game", "URI:spiffe://example/game,DNS:ignored")
        with Client(daemon.address, self.files, certificate=game).session() as session:
            self.assertEqual(session.tick().sequence, 1)
        self.refused(UNAUTHENTICATED, Client(daemon.address, self.files, certificate=self.files.authority.sign("stranger", "")).info)
        board = Client(daemon.address, self.files, BOARD, certificate=self.files.authority.sign("stranger", ""))
        self.assertEqual(board.stats().access.failed_handshakes, 0)
        folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        forged = Authority(folder).sign("game", "URI:spiffe://example/game")
        for certificate in (forged, None, self.files.authority.sign("server", use="serverAuth")):
            self.refused(grpc.StatusCode.UNAVAILABLE, Client(daemon.address, self.files, GAME, certificate=certificate).info)
        wait_for(lambda: board.stats().access.failed_handshakes >= 3)  # a client may hear of its failure first
        daemon.wait_for_log("certificate")

    def test_a_certificate_without_an_access_file_is_an_identity(self):
        address = self.daemon(*self.files.tls, "--tls-client-ca", str(self.files.authority.certificate), "--max-sessions-per-client", "1").address
        one, two = (Client(address, self.files, certificate=self.files.authority.sign(name, "")) for name in ("one", "two"))
        with one.session():
            self.refused(grpc.StatusCode.RESOURCE_EXHAUSTED, one.session)
            two.session().close()

    def test_old_protocols_and_others_than_http2_are_refused(self):
        address = self.daemon(*self.files.tls).address
        for wrong in ({"maximum_version": ssl.TLSVersion.TLSv1_1, "minimum_version": ssl.TLSVersion.TLSv1}, {"alpn": ["http/1.1"]}, {"alpn": []}):
            with self.subTest(**wrong), self.assertRaises((ssl.SSLError, OSError)):
                served_certificate(address, self.files, **wrong)
        served_certificate(address, self.files, maximum_version=ssl.TLSVersion.TLSv1_2)


def healthcheck(*arguments):
    return subprocess.run([attack.Daemon.path, "healthcheck", *map(str, arguments)], capture_output=True, text=True, timeout=30)


class Healthcheck(Case):
    """The command `sightlined healthcheck` has no credentials of its own."""

    def asked(self, daemon, *flags):
        """The exit status for a probe that has the daemon's flags, with the port that it took."""
        result = healthcheck(*flags, "--listen", daemon.address)
        self.assertEqual("is SERVING" in result.stdout, result.returncode == 0, result.stderr)
        return result.returncode

    def test_over_tls_by_the_daemon_s_own_flags(self):
        daemon = self.daemon(*self.files.all)
        self.assertEqual(self.asked(daemon, *self.files.all), 0)
        self.assertEqual(self.asked(daemon, *self.files.all, "--live"), 0)
        # The certificate has no name of the host, and the daemon shows the former one for a while after this.
        self.files.use(*self.files.authority.sign("second", "DNS:cameras.example"))
        self.assertEqual(self.asked(daemon, *self.files.all), 0)
        daemon.process.send_signal(signal.SIGHUP)
        daemon.wait_for_log("credentials taken over")
        self.assertEqual(self.asked(daemon, *self.files.all), 0)

    def test_over_tls_by_the_address_alone(self):
        daemon = self.daemon(*self.files.all)
        self.assertEqual(healthcheck("--address", daemon.address, "--tls").returncode, 0)
        unencrypted = healthcheck("--address", daemon.address)
        self.assertEqual((unencrypted.returncode, unencrypted.stdout), (1, ""))

    def test_a_daemon_without_tls_is_not_taken_for_one_with_it(self):
        plain = self.daemon()
        self.assertEqual(healthcheck("--address", plain.address).returncode, 0)
        self.assertEqual(healthcheck("--address", plain.address, "--tls").returncode, 1)

    def test_a_daemon_that_wants_certificates_is_shown_its_own(self):
        flags = [*self.files.all, "--tls-client-ca", str(self.files.authority.certificate)]
        daemon = self.daemon(*flags)
        self.assertEqual(self.asked(daemon, *flags), 0)
        self.assertEqual(self.asked(daemon, *self.files.all), 1, "without a certificate the handshake fails")

    def test_a_daemon_that_has_ended_is_not_well(self):
        daemon = self.daemon(*self.files.all)
        address = daemon.address
        daemon.stop()
        self.assertEqual(healthcheck(*self.files.all, "--listen", address).returncode, 1)

    def test_a_unix_socket_is_asked_without_tls(self):
        path = str(self.files.folder / "socket")
        flags = [*self.files.all, "--listen-unix", path]
        self.daemon(*flags)
        self.assertEqual(healthcheck(*flags).returncode, 0)
        self.assertEqual(healthcheck("--address", "unix:" + path, "--tls").returncode, 0)


class Floods(Case):
    """What is encrypted is watched like the rest."""

    def tls_connection(self, address):
        context = ssl.create_default_context(cafile=self.files.authority.certificate)
        context.set_alpn_protocols(["h2"])
        connection = attack.RawConnection(address, greet=False)
        connection.socket = context.wrap_socket(connection.socket, server_hostname="127.0.0.1")
        connection.send(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + attack.frame(attack.SETTINGS, 0, 0))
        return connection

    def test_rapid_resets_over_tls_are_cut(self):
        daemon = self.daemon(*self.files.all)
        connection = self.tls_connection(daemon.address)

        def resets():
            data = b""
            for _ in range(100):
                stream, headers = connection.call(attack.CONTROL)
                data += headers + attack.frame(attack.RST_STREAM, 0, stream, struct.pack(">I", 8))
            return data

        sent = attack.flood(connection, resets, 8)
        self.assertLess(sent, 4 << 20)
        self.assertLess(daemon.most_memory_mib(), 200)
        daemon.wait_for_log("connection refused")

    def test_handshakes_that_never_end_leave_room(self):
        address = self.daemon(*self.files.all, "--max-connections", "16").address
        with contextlib.ExitStack() as idle:
            for _ in range(40):
                connection = attack.connect(address)
                idle.callback(connection.close)
                connection.sendall(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03")  # the head of a greeting
            with Client(address, self.files, GAME).session() as session:
                self.assertEqual(session.tick().sequence, 1)

    def test_noise_is_not_a_handshake(self):
        daemon = self.daemon(*self.files.all)
        for noise in (b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", os.urandom(4096), b"\x16\x03\x01\xff\xff" + bytes(70000)):
            with attack.connect(daemon.address) as connection, contextlib.suppress(OSError):
                connection.sendall(noise)
                while connection.recv(4096):
                    pass
        wait_for(lambda: Client(daemon.address, self.files, ROOT).stats().access.failed_handshakes == 4)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
