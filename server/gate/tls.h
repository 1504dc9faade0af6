// TLS for accepted connections, with OpenSSL.
//
// The gate ends TLS itself, because it must see the frames of HTTP/2 to cut a connection that floods; gRPC gets plain
// bytes. TLS 1.2 and 1.3 are spoken, with forward secrecy, and the client must ask for "h2" (ALPN). There are no
// session tickets and no renegotiation: each connection shows its certificate anew.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/base/mutex.h"
#include "server/gate/settled_files.h"

struct bio_st;
struct ssl_ctx_st;
struct ssl_st;

namespace sightline {

// The TLS of one connection, without its socket: bytes go in and out. Not thread-safe.
class TlsStream {
 public:
  // Takes over `ssl`, which must be set up for a server.
  explicit TlsStream(ssl_st* ssl);
  ~TlsStream();
  TlsStream(const TlsStream&) = delete;
  TlsStream& operator=(const TlsStream&) = delete;

  // Takes bytes of the client. Until the handshake is over they are only kept and answered.
  // False: the connection must end, and trouble() says why. What is left in take_outgoing() should still be sent.
  bool receive(std::span<const std::byte> sealed);
  // Appends what the client has said so far. False as above.
  bool open(std::vector<std::byte>& plain);
  // Seals bytes for the client. False as above.
  bool seal(std::span<const std::byte> plain);
  // Says goodbye to the client.
  void close();
  // Appends what must be sent to the client now.
  void take_outgoing(std::vector<std::byte>& sealed);

  bool established() const { return established_; }
  // The client has said goodbye.
  bool ended() const { return ended_; }
  const std::string& trouble() const { return trouble_; }
  // Who the client is by its certificate, which was verified: its first URI, otherwise its first DNS name, otherwise
  // its common name. Empty when it has shown none, or none with a name of printable characters without spaces.
  std::string certificate_name() const;

 private:
  struct Free {
    void operator()(ssl_st* ssl) const;
  };
  bool failed(int result);
  static void watch(int write, int version, int type, const void* bytes, size_t size, ssl_st* ssl, void* stream);

  const std::unique_ptr<ssl_st, Free> ssl_;
  bio_st *incoming_, *outgoing_;  // owned by ssl_
  bool established_ = false, ended_ = false;
  int key_updates_ = 0;
  std::string trouble_;
};

// PEM files. `certificate`: the server's, followed by those between it and its root. `client_ca`: whose certificates
// clients must show; empty: clients need none.
struct TlsFiles {
  std::string certificate, key, client_ca;
};

// The certificate and key for new connections. Thread-safe.
class TlsKeys {
 public:
  // Fails with kInvalidArgument, field "--tls-cert", "--tls-key" or "--tls-client-ca".
  static Result<std::unique_ptr<TlsKeys>> load(TlsFiles files);

  // Looks at the files again. True: they have changed and settled (SettledFiles), and new connections use them. False:
  // there is nothing new. When they cannot be used, the result is an error as of `load`, once for each change, and the
  // former ones stay in use.
  Result<bool> reload(SettledFiles::Time now);
  bool settling() const { return settled_.settling(); }
  // What others can do with the files; see exposed_by_mode.
  std::vector<std::string> exposed() const;
  // For a new connection. Null when memory has run out.
  std::unique_ptr<TlsStream> accept() const;
  // When the certificate for new connections stops being valid, in seconds since 1970.
  int64_t expires_s() const;
  // Clients must show a certificate.
  bool asks_for_certificates() const { return !files_.client_ca.empty(); }

 private:
  struct Contents {
    std::string certificate, key, client_ca;
  };
  using Context = std::shared_ptr<ssl_ctx_st>;

  explicit TlsKeys(TlsFiles files);
  Status take(const SettledFiles::Texts& texts);
  static Result<Context> make(const Contents& contents);

  const TlsFiles files_;
  SettledFiles settled_;  // certificate, key, client_ca; used by one thread at a time
  mutable Mutex mutex_;
  Context context_ GUARDED(mutex_);
};

}  // namespace sightline
