#!/usr/bin/env python3
"""Plays a session with each client over TLS, with tokens and with certificates: trust_test.py SIGHTLINED STUBS NAME=COMMAND...

The arguments are those of conformance_test.py, without its README.
"""
import json
import pathlib
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).parent
# The players' module has its own view of the arguments.
sys.argv.insert(3, "")
sys.path.insert(0, str(HERE.parent / "attack"))
from conformance_test import PLAYERS, SESSIONS, SIGHTLINED, Player, comparable, play  # noqa: E402

from certificates import Authority  # noqa: E402
from daemon import Daemon  # noqa: E402

# A program gives the C# client its channel, with the credentials in it, so there is nothing of the client to test.
PLAYERS = {name: player for name, player in PLAYERS.items() if not name.startswith("C#")}
SECRET, OBSERVER = "conformance-0123456789", "observer-0123456789abc"
STEPS = SESSIONS["convention_gltf"]["steps"]


class Trusting:
    """A daemon as `play` needs it, whose clients say who they are."""

    def __init__(self, daemon, address=None):
        self.address = address or daemon.address


class TrustedPlayer(Player):
    def __init__(self, client, **trust):
        super().__init__(client)
        self.trust = {name: str(value) for name, value in trust.items()}

    def run(self, command):
        return super().run(command | {"trust": self.trust} if "open" in command else command)


class Trust(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.authority, cls.stranger = Authority(folder), Authority(folder, "stranger")
        certificate, key = cls.authority.sign("daemon")
        access = folder / "access"
        access.write_text(f"token game control {SECRET}\ntoken board observe {OBSERVER}\ncertificate game-1 control\n")
        cls.socket = f"unix:{folder}/socket"
        files = ["--tls-cert", certificate, "--tls-key", key, "--access-file", access]
        cls.plain = cls.enterClassContext(Daemon(SIGHTLINED))
        cls.daemon = cls.enterClassContext(Daemon(SIGHTLINED, *files, "--listen-unix", f"{folder}/socket"))
        cls.mutual = cls.enterClassContext(Daemon(SIGHTLINED, *files, "--tls-client-ca", cls.authority.certificate))
        cls.game_1 = cls.authority.sign("game-1", "")

    def answers(self, client, daemon, **trust):
        player = TrustedPlayer(client, **trust)
        answers = play(player, daemon, STEPS)
        player.close()
        return [comparable(answer) for answer in answers]

    def code(self, client, daemon, **trust):
        """The code with which the opening fails."""
        player = TrustedPlayer(client, **trust)
        answer, = play(player, daemon, STEPS[:1])
        player.process.stdin.close()
        player.process.wait(20)
        player.process.stdout.close()
        self.assertIn("failed", answer, json.dumps(answer)[:300])
        return answer["failed"]["code"]

    def test_a_client_that_is_known_gets_the_same_replies(self):
        roots, (certificate, key) = self.authority.certificate, self.game_1
        for client in PLAYERS:
            plain = self.answers(client, self.plain)
            with self.subTest(client=client, by="token"):
                self.assertEqual(self.answers(client, self.daemon, roots=roots, token=SECRET), plain)
            with self.subTest(client=client, by="certificate"):
                self.assertEqual(self.answers(client, self.mutual, roots=roots, certificate=certificate, key=key), plain)
            with self.subTest(client=client, by="token on a unix socket"):
                self.assertEqual(self.answers(client, Trusting(self.daemon, self.socket), token=SECRET), plain)

    def test_a_client_that_is_not_known_is_refused(self):
        roots = self.authority.certificate
        for client in PLAYERS:
            # The C++ client has one code for all preconditions.
            unknown, denied = ("FAILED_PRECONDITION",) * 2 if client == "C++" else ("UNAUTHENTICATED", "PERMISSION_DENIED")
            with self.subTest(client=client):
                self.assertEqual(self.code(client, self.daemon, roots=roots, token=SECRET + "x"), unknown)
                self.assertEqual(self.code(client, self.daemon, roots=roots), unknown)
                self.assertEqual(self.code(client, self.daemon, roots=roots, token=OBSERVER), denied)
                # With TLS 1.3 the refusal comes when the client's own handshake is over, and tonic has no code for that. CANCELLED: the connection closes
                # while the client sends its call.
                self.assertIn(self.code(client, self.mutual, roots=roots, token=SECRET), ("UNAVAILABLE", "UNKNOWN", "CANCELLED"))
                self.assertEqual(self.code(client, self.daemon, roots=self.stranger.certificate, token=SECRET), "UNAVAILABLE", "the daemon is a stranger")

    def test_a_client_does_not_send_its_token_to_everyone(self):
        for client in PLAYERS:
            with self.subTest(client=client):
                self.assertEqual(self.code(client, self.plain, token=SECRET), "INVALID_ARGUMENT")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
