// TLS at the gate: handshakes with OpenSSL's own client, and the files.
#include "server/gate/tls.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>
#include <filesystem>
#include <fstream>

#include "server/gate/credentials.h"
#include "tests/gate/certificates.h"
#include "tests/gate/frames.h"
#include "tests/gate/gate_world.h"
#include "tests/gate/settling_clock.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::becomes;
using test::ends;
using test::GateWorld;
using test::SignedPair;
using testing::HasSubstr;
using testing::StartsWith;

// An authority and the files that it made for a server.
class TlsFolder {
 public:
  TlsFolder() {
    use(authority.sign("server"));
    write("authority", authority.certificate());
  }
  void write(const char* name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  void use(const SignedPair& pair) const {
    write("certificate", pair.certificate);
    write("key", pair.key);
  }
  std::string path(const char* name) const { return folder_ / name; }
  TlsFiles files(bool asks_clients = false) const {
    return {path("certificate"), path("key"), asks_clients ? path("authority") : ""};
  }

  const test::Authority authority;

 private:
  const test::TemporaryFolder folder_;
};

// A client of OpenSSL's on a connected socket that waits.
class TlsClient {
 public:
  explicit TlsClient(int fd, const std::string& protocol = "h2", const SignedPair& own = {},
                     int newest = TLS1_3_VERSION)
      : context_(SSL_CTX_new(TLS_client_method()), &SSL_CTX_free) {
    SSL_CTX_set_max_proto_version(context_.get(), newest);
    if (!own.certificate.empty()) show(own);
    ssl_.reset(SSL_new(context_.get()));
    const std::string list = static_cast<char>(protocol.size()) + protocol;
    if (!protocol.empty())
      SSL_set_alpn_protos(ssl_.get(), reinterpret_cast<const unsigned char*>(list.data()),
                          static_cast<unsigned>(list.size()));
    const timeval timeout{20, 0};
    ::setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
    SSL_set_fd(ssl_.get(), fd);
    connected_ = SSL_connect(ssl_.get()) == 1;
  }
  bool connected() const { return connected_; }
  void send(const std::string& bytes) { SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size())); }
  std::string receive(size_t size) {
    std::string bytes(size, '\0');
    size_t at = 0;
    while (at < size) {
      const int more = SSL_read(ssl_.get(), bytes.data() + at, static_cast<int>(size - at));
      if (more <= 0) break;
      at += static_cast<size_t>(more);
    }
    return bytes.substr(0, at);
  }
  void say_goodbye() { SSL_shutdown(ssl_.get()); }
  // Waits for the server's goodbye, on which nothing else comes.
  bool hears_goodbye() {
    char byte;
    const int size = SSL_read(ssl_.get(), &byte, 1);
    return SSL_get_error(ssl_.get(), size) == SSL_ERROR_ZERO_RETURN;
  }
  int certificates_shown() const { return sk_X509_num(SSL_get_peer_cert_chain(ssl_.get())); }

 private:
  void show(const SignedPair& own) {
    const std::unique_ptr<BIO, decltype(&BIO_free)> certificate(BIO_new_mem_buf(own.certificate.data(), -1), &BIO_free),
        key(BIO_new_mem_buf(own.key.data(), -1), &BIO_free);
    const std::unique_ptr<X509, decltype(&X509_free)> first(
        PEM_read_bio_X509(certificate.get(), nullptr, nullptr, nullptr), &X509_free);
    const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> second(
        PEM_read_bio_PrivateKey(key.get(), nullptr, nullptr, nullptr), &EVP_PKEY_free);
    SSL_CTX_use_certificate(context_.get(), first.get());
    SSL_CTX_use_PrivateKey(context_.get(), second.get());
  }

  std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context_;
  std::unique_ptr<SSL, decltype(&SSL_free)> ssl_{nullptr, &SSL_free};
  bool connected_ = false;
};

std::unique_ptr<TlsKeys> load(const TlsFiles& files) {
  auto keys = TlsKeys::load(files);
  EXPECT_TRUE(keys) << to_string(keys.error());
  return std::move(*keys);
}

// --- connections

TEST(TlsGate, WhatIsEncryptedPassesBothWaysAndEndsWithAGoodbye) {
  const TlsFolder folder;
  const auto keys = load(folder.files());
  for (const int newest : {TLS1_2_VERSION, TLS1_3_VERSION}) {
    GateWorld world({}, keys.get());
    const FileDescriptor socket = world.connect();
    FileDescriptor grpc = world.admitted();
    test::send_all(grpc.get(), "early");  // before the client can hear it
    TlsClient client(socket.get(), "h2", {}, newest);
    ASSERT_TRUE(client.connected());
    EXPECT_EQ(client.receive(5), "early");
    const std::string asked = test::greeting() + test::call(0) + test::frame(0, 0, 1, 50'000);
    client.send(asked);
    EXPECT_TRUE(test::receive(grpc.get(), asked.size()) == asked);
    const std::string answer(40'000, 'a');
    test::send_all(grpc.get(), answer);
    EXPECT_TRUE(client.receive(answer.size()) == answer);
    EXPECT_EQ(world.gate().counts().received_bytes, asked.size());
    const Peer peer = world.gate().peer_of(GateWorld::peer_name(grpc.get()));
    EXPECT_TRUE(peer.confidential);
    EXPECT_EQ(peer.client, "127.0.0.1");
    EXPECT_EQ(peer.certificate, "");
    grpc = {};
    EXPECT_TRUE(client.hears_goodbye());
    EXPECT_TRUE(becomes([&] { return world.gate().counts().open == 0; }));
    EXPECT_EQ(world.gate().counts().cut, 0u);
    EXPECT_EQ(world.gate().counts().failed_handshakes, 0u);
  }
}

TEST(TlsGate, TheGoodbyeOfAClientReachesGrpc) {
  const TlsFolder folder;
  const auto keys = load(folder.files());
  GateWorld world({}, keys.get());
  const FileDescriptor socket = world.connect(), grpc = world.admitted();
  TlsClient client(socket.get());
  client.send(test::greeting());
  client.say_goodbye();
  EXPECT_EQ(test::receive(grpc.get(), 1000), test::greeting()) << "and then the end";
}

TEST(TlsGate, ClientsAreKnownByTheirCertificates) {
  const TlsFolder folder;
  const auto keys = load(folder.files(true));
  EXPECT_TRUE(keys->asks_for_certificates());
  const std::pair<SignedPair, const char*> clients[] = {
      {folder.authority.sign("common", "DNS:dns.example,URI:spiffe://example/game,URI:spiffe://example/other"),
       "spiffe://example/game"},
      {folder.authority.sign("common", "IP:127.0.0.1,DNS:dns.example,DNS:more.example"), "dns.example"},
      {folder.authority.sign("common"), "common"},
      {folder.authority.sign("not plain"), ""}};
  for (const auto& [own, name] : clients) {
    GateWorld world({}, keys.get());
    const FileDescriptor socket = world.connect(), grpc = world.admitted();
    TlsClient client(socket.get(), "h2", own);
    client.send(test::greeting());
    EXPECT_EQ(test::receive(grpc.get(), test::greeting().size()), test::greeting());
    EXPECT_EQ(world.gate().peer_of(GateWorld::peer_name(grpc.get())).certificate, name);
  }
}

// The reason for which the handshake of this client fails.
template <typename... Arguments>
std::string failed_handshake(const TlsKeys& keys, const Arguments&... arguments) {
  GateWorld world({}, &keys);
  const FileDescriptor socket = world.connect(), grpc = world.admitted();
  TlsClient client(socket.get(), arguments...);
  EXPECT_EQ(client.receive(1), "");
  const std::string reason = world.reason();
  EXPECT_EQ(world.gate().counts().failed_handshakes, 1u);
  EXPECT_EQ(world.gate().counts().cut, 1u);
  EXPECT_TRUE(ends(grpc.get()));
  return reason;
}

TEST(TlsGate, AHandshakeThatFailsIsCutForAReason) {
  const TlsFolder folder;
  const auto open = load(folder.files()), asks = load(folder.files(true));
  EXPECT_EQ(failed_handshake(*open, ""), "no TLS handshake: the client does not ask for h2");
  EXPECT_THAT(failed_handshake(*open, "http/1.1"), StartsWith("no TLS handshake: "));
  EXPECT_THAT(failed_handshake(*open, "h2", SignedPair{}, TLS1_1_VERSION), StartsWith("no TLS handshake: "));
  EXPECT_THAT(failed_handshake(*asks), HasSubstr("certificate"));
  EXPECT_THAT(failed_handshake(*asks, "h2", test::Authority().sign("forged")), HasSubstr("certificate"));
  EXPECT_THAT(failed_handshake(*asks, "h2", folder.authority.sign("expired", "", -60)), HasSubstr("certificate"));
}

TEST(TlsGate, AClientMayNotShakeHandsAllTheTime) {
  const TlsFolder folder;
  const auto keys = load(folder.files());
  GateLimits limits;
  limits.handshakes_burst = 2;
  limits.handshakes_per_s = 1e-6;
  GateWorld world(limits, keys.get());
  std::vector<FileDescriptor> sockets;
  for (int i = 0; i < 2; ++i) {
    sockets.push_back(world.connect());
    EXPECT_TRUE(TlsClient(sockets.back().get()).connected());
  }
  const FileDescriptor refused = world.connect();
  EXPECT_TRUE(ends(refused.get()));
  EXPECT_EQ(world.reason(), "too many TLS handshakes in a short time");
}

// --- the files

TEST(TlsKeys, TheCertificatesUpToTheRootAreShownToo) {
  const TlsFolder folder;
  folder.write("certificate", folder.authority.sign("first").certificate);
  const SignedPair server = folder.authority.sign("server");
  folder.use(server);
  folder.write("certificate",
               server.certificate + folder.authority.sign("between").certificate + folder.authority.certificate());
  const auto keys = load(folder.files());
  GateWorld world({}, keys.get());
  const FileDescriptor socket = world.connect();
  EXPECT_EQ(TlsClient(socket.get()).certificates_shown(), 3);
}

// The field and the message of the error with these files.
std::string trouble_with(const TlsFiles& files) {
  const auto keys = TlsKeys::load(files);
  return keys ? "none" : keys.error().field + " " + keys.error().message;
}

TEST(TlsKeys, FilesThatCannotBeUsedAreNamed) {
  const TlsFolder folder;
  folder.write("nothing", "");
  folder.write("words", "nothing");
  const std::string certificate = folder.path("certificate"), key = folder.path("key"), words = folder.path("words");
  EXPECT_THAT(trouble_with({words, key, ""}), HasSubstr("--tls-cert the file holds no certificate"));
  EXPECT_THAT(trouble_with({certificate, words, ""}), HasSubstr("--tls-key the file holds no unencrypted key"));
  EXPECT_THAT(trouble_with({certificate, key, words}), HasSubstr("--tls-client-ca the file holds no certificate"));
  EXPECT_THAT(trouble_with({certificate, key, folder.path("nothing")}), HasSubstr("--tls-client-ca the file is empty"));
  for (const TlsFiles& files :
       {TlsFiles{"/nowhere", key, ""}, TlsFiles{certificate, "/nowhere", ""}, TlsFiles{certificate, key, "/nowhere"}})
    EXPECT_THAT(trouble_with(files), HasSubstr("No such file"));
  folder.write("key", folder.authority.sign("other").key);
  EXPECT_THAT(trouble_with(folder.files()), HasSubstr("--tls-key the key does not belong to the certificate"));
  folder.use(folder.authority.sign("old", "", -60));
  EXPECT_THAT(trouble_with(folder.files()), HasSubstr("--tls-cert the certificate has expired"));
}

// A copy that is cut off anywhere within a certificate may still have whole ones before it.
TEST(TlsKeys, AFileThatIsCutOffWithinACertificateIsNotTaken) {
  const TlsFolder folder;
  const SignedPair server = folder.authority.sign("chained");
  folder.use(server);
  const std::string chain = server.certificate + folder.authority.certificate();
  for (size_t size = 0; size + 1 < chain.size(); ++size) {
    if (size + 1 == server.certificate.size() || size == server.certificate.size()) continue;  // the first one, whole
    folder.write("certificate", chain.substr(0, size));
    EXPECT_NE(trouble_with(folder.files()), "none") << size;
    folder.write("certificate", chain);
    folder.write("authority", chain.substr(0, size));
    EXPECT_NE(trouble_with(folder.files(true)), "none") << size;
  }
  folder.write("certificate", "a comment\n" + chain + "\nanother\n\n");
  EXPECT_EQ(trouble_with(folder.files()), "none");
  folder.write("certificate", chain + server.key);
  EXPECT_EQ(trouble_with(folder.files()), "none") << "the key may stand there too";
}

TEST(TlsKeys, OthersMayNotReadTheKeyNorWriteAnyFile) {
  namespace fs = std::filesystem;
  const TlsFolder folder;
  const auto exposed = [&] { return load(folder.files())->exposed(); };
  fs::permissions(folder.path("certificate"), fs::perms(0644));
  fs::permissions(folder.path("key"), fs::perms(0640));
  EXPECT_TRUE(exposed().empty());
  fs::permissions(folder.path("key"), fs::perms(0644));
  ASSERT_EQ(exposed().size(), 1u);
  EXPECT_THAT(exposed()[0], HasSubstr("key: others can read it (mode 0644)"));
  fs::permissions(folder.path("certificate"), fs::perms(0666));
  EXPECT_EQ(exposed().size(), 2u);
}

TEST(TlsKeys, NewFilesAreTakenOverAndBrokenOnesAreToldOnce) {
  const TlsFolder folder;
  const auto keys = load(folder.files());
  const auto in_s = [&] { return static_cast<double>(keys->expires_s() - std::time(nullptr)); };
  EXPECT_NEAR(in_s(), 3600, 60);
  test::SettlingClock clock;
  const auto reload = [&] { return clock.settle([&](auto now) { return keys->reload(now); }); };
  EXPECT_EQ(reload().value(), false);
  const SignedPair next = folder.authority.sign("next", "", 7200);
  folder.write("certificate", next.certificate);  // the key is still the former one
  EXPECT_FALSE(reload());
  EXPECT_EQ(reload().value(), false) << "it was told already";
  EXPECT_NEAR(in_s(), 3600, 60) << "the former one stays in use";
  folder.use(next);
  EXPECT_EQ(reload().value(), true);
  EXPECT_NEAR(in_s(), 7200, 60);
}

TEST(Credentials, AreThoseOfTheirFilesAndCountTheChanges) {
  const TlsFolder folder;
  folder.write("access", "token a control 0123456789abcdef\n");
  const auto credentials = Credentials::load({folder.path("access"), folder.files()});
  ASSERT_TRUE(credentials);
  const Peer peer{"10.0.0.1", std::nullopt, {}, true};
  const auto known = [&](const char* token) {
    return (*credentials)->access().identify(peer, token, Need::kControl).has_value();
  };
  EXPECT_TRUE(known("0123456789abcdef"));
  EXPECT_FALSE(known("another----------"));
  EXPECT_NE((*credentials)->tls(), nullptr);
  test::SettlingClock clock;
  const auto reload = [&] { return clock.settle([&](auto now) { return (*credentials)->reload(now); }); };
  EXPECT_TRUE(reload().empty());
  EXPECT_FALSE((*credentials)->settling());
  folder.write("access", "nonsense\n");
  folder.use(folder.authority.sign("next"));
  const auto changes = reload();
  ASSERT_EQ(changes.size(), 2u);
  EXPECT_EQ(changes[0].what, "access file");
  EXPECT_TRUE(changes[0].trouble);
  EXPECT_EQ(changes[1].what, "certificate");
  EXPECT_FALSE(changes[1].trouble);
  EXPECT_EQ((*credentials)->refused(), 1u);
  EXPECT_EQ((*credentials)->taken_over(), 1u);
  EXPECT_FALSE((*credentials)->access_file().current);
  EXPECT_TRUE((*credentials)->certificate().current);
}

TEST(Credentials, WithoutFilesEveryoneMaySpeakUnencrypted) {
  const auto credentials = Credentials::load({});
  ASSERT_TRUE(credentials);
  EXPECT_EQ((*credentials)->tls(), nullptr);
  EXPECT_TRUE((*credentials)->access().identify({"10.0.0.1", std::nullopt, {}, false}, std::nullopt, Need::kControl));
  EXPECT_TRUE((*credentials)->reload({}).empty());
}

}  // namespace
}  // namespace sightline
