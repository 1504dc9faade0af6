#include "server/gate/tls.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <string_view>
#include <utility>

#include "server/gate/small_file.h"

namespace sightline {
namespace {

constexpr char kCertificate[] = "--tls-cert", kKey[] = "--tls-key", kClientCa[] = "--tls-client-ca";
// Each costs a derivation of keys. An honest client needs one for each few gigabytes.
constexpr int kMostKeyUpdates = 64;
constexpr long kMostCertificateBytes = 32 << 10;
constexpr unsigned char kHttp2[] = {2, 'h', '2'};

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using Key = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;
using Names = std::unique_ptr<GENERAL_NAMES, decltype(&GENERAL_NAMES_free)>;

// The newest reason in OpenSSL's queue of errors, which is then empty.
std::string openssl_reason() {
  const unsigned long error = ERR_peek_last_error();
  ERR_clear_error();
  const char* const reason = error ? ERR_reason_error_string(error) : nullptr;
  return reason ? reason : "the connection is broken";
}

Bio text_bio(const std::string& text) {
  return {BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), &BIO_free};
}

// A key that is encrypted would otherwise ask for its password at the terminal.
int no_password(char*, int, int, void*) {
  return 0;
}

// The last line that is not empty begins like the mark of a block, but does not end one: the file is cut off within its
// mark.
bool ends_within_mark(const std::string& text) {
  const size_t end = text.find_last_not_of(" \t\r\n");
  if (end == std::string::npos) return false;
  const size_t before = text.rfind('\n', end), start = before == std::string::npos ? 0 : before + 1;
  const std::string_view line = std::string_view(text).substr(start, end + 1 - start);
  return line.starts_with('-') && !(line.starts_with("-----END ") && line.ends_with("-----"));
}

// All certificates of the file, in its order. Fails when one of them is cut off or cannot be read.
Result<std::vector<Certificate>> read_certificates(const std::string& text, const char* flag) {
  std::vector<Certificate> found;
  const Bio bio = text_bio(text);
  while (X509* next = PEM_read_bio_X509(bio.get(), nullptr, &no_password, nullptr))
    found.emplace_back(next, &X509_free);
  const bool at_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE && !ends_within_mark(text);
  const std::string reason = openssl_reason();
  if (found.empty() && at_end) return invalid(flag, "the file holds no certificate in PEM format");
  if (!at_end)
    return invalid(flag,
                   "certificate " + std::to_string(found.size() + 1) + " of the file is cut off or damaged: " + reason);
  return found;
}

Status use_certificate(SSL_CTX* context, const std::string& text) {
  const auto read = read_certificates(text, kCertificate);
  if (!read) return tl::unexpected(read.error());
  const std::vector<Certificate>& chain = *read;
  if (SSL_CTX_use_certificate(context, chain.front().get()) != 1) return invalid(kCertificate, openssl_reason());
  for (size_t i = 1; i < chain.size(); ++i)
    if (SSL_CTX_add1_chain_cert(context, chain[i].get()) != 1) return invalid(kCertificate, openssl_reason());
  if (X509_cmp_current_time(X509_get0_notAfter(chain.front().get())) <= 0)
    return invalid(kCertificate, "the certificate has expired");
  return {};
}

Status use_key(SSL_CTX* context, const std::string& text) {
  const Key key(PEM_read_bio_PrivateKey(text_bio(text).get(), nullptr, &no_password, nullptr), &EVP_PKEY_free);
  ERR_clear_error();
  if (!key) return invalid(kKey, "the file holds no unencrypted key in PEM format");
  if (SSL_CTX_use_PrivateKey(context, key.get()) != 1 || SSL_CTX_check_private_key(context) != 1) {
    ERR_clear_error();
    return invalid(kKey, "the key does not belong to the certificate");
  }
  return {};
}

Status use_client_ca(SSL_CTX* context, const std::string& text) {
  const auto roots = read_certificates(text, kClientCa);
  if (!roots) return tl::unexpected(roots.error());
  for (const Certificate& root : *roots) {
    if (X509_STORE_add_cert(SSL_CTX_get_cert_store(context), root.get()) != 1 ||
        SSL_CTX_add_client_CA(context, root.get()) != 1)
      return invalid(kClientCa, openssl_reason());
  }
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  return {};
}

int choose_http2(SSL*, const unsigned char** chosen, unsigned char* size, const unsigned char* offered,
                 unsigned offered_size, void*) {
  unsigned char* found = nullptr;
  const int result = SSL_select_next_proto(&found, size, kHttp2, sizeof(kHttp2), offered, offered_size);
  *chosen = found;
  return result == OPENSSL_NPN_NEGOTIATED ? SSL_TLSEXT_ERR_OK : SSL_TLSEXT_ERR_ALERT_FATAL;
}

bool set_up(SSL_CTX* context) {
  SSL_CTX_set_options(
      context, SSL_OP_NO_TICKET | SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);
  SSL_CTX_set_num_tickets(context, 0);
  SSL_CTX_set_mode(context, SSL_MODE_RELEASE_BUFFERS);
  SSL_CTX_set_max_cert_list(context, kMostCertificateBytes);
  SSL_CTX_set_alpn_select_cb(context, &choose_http2, nullptr);
  return SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION) == 1 &&
         SSL_CTX_set_cipher_list(context, "ECDHE+AESGCM:ECDHE+CHACHA20") == 1;
}

std::string printable(const ASN1_STRING* text) {
  const std::string name(reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)),
                         static_cast<size_t>(ASN1_STRING_length(text)));
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < 127; });
  return plain ? name : std::string();
}

// The first alternative name of a kind.
const ASN1_STRING* alternative_name(const GENERAL_NAMES* names, int kind) {
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names); ++i) {
    int type = 0;
    const void* const value = GENERAL_NAME_get0_value(sk_GENERAL_NAME_value(names, i), &type);
    if (type == kind) return static_cast<const ASN1_STRING*>(value);
  }
  return nullptr;
}

const ASN1_STRING* common_name(const X509* certificate) {
  const X509_NAME* const subject = X509_get_subject_name(certificate);
  const int at = X509_NAME_get_index_by_NID(subject, NID_commonName, -1);
  return at < 0 ? nullptr : X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at));
}

}  // namespace

// --- one connection
// -----------------------------------------------------------------------------------------------------

void TlsStream::Free::operator()(ssl_st* ssl) const {
  SSL_free(ssl);
}

TlsStream::TlsStream(ssl_st* ssl) : ssl_(ssl), incoming_(BIO_new(BIO_s_mem())), outgoing_(BIO_new(BIO_s_mem())) {
  SSL_set_bio(ssl, incoming_, outgoing_);
  SSL_set_accept_state(ssl);
  SSL_set_msg_callback(ssl, &TlsStream::watch);
  SSL_set_msg_callback_arg(ssl, this);
}

TlsStream::~TlsStream() = default;

void TlsStream::watch(int write, int, int type, const void* bytes, size_t size, ssl_st*, void* stream) {
  const bool handshake = write == 0 && type == SSL3_RT_HANDSHAKE && size > 0;
  if (handshake && *static_cast<const unsigned char*>(bytes) == SSL3_MT_KEY_UPDATE)
    ++static_cast<TlsStream*>(stream)->key_updates_;
}

bool TlsStream::receive(std::span<const std::byte> sealed) {
  if (!sealed.empty() &&
      BIO_write(incoming_, sealed.data(), static_cast<int>(sealed.size())) != static_cast<int>(sealed.size())) {
    trouble_ = "out of memory";
    return false;
  }
  if (established_) return true;
  ERR_clear_error();
  const int result = SSL_do_handshake(ssl_.get());
  if (result != 1) return !failed(result);
  const unsigned char* protocol = nullptr;
  unsigned size = 0;
  SSL_get0_alpn_selected(ssl_.get(), &protocol, &size);
  if (size == 0) {
    trouble_ = "the client does not ask for h2";
    return false;
  }
  established_ = true;
  return true;
}

bool TlsStream::open(std::vector<std::byte>& plain) {
  std::array<std::byte, 16 << 10> record;
  for (;;) {
    ERR_clear_error();
    const int size = SSL_read(ssl_.get(), record.data(), static_cast<int>(record.size()));
    if (key_updates_ > kMostKeyUpdates) trouble_ = "too many changes of keys";
    if (!trouble_.empty()) return false;
    if (size <= 0) return !failed(size);
    plain.insert(plain.end(), record.begin(), record.begin() + size);
  }
}

bool TlsStream::seal(std::span<const std::byte> plain) {
  ERR_clear_error();
  if (plain.empty()) return true;
  const int result = SSL_write(ssl_.get(), plain.data(), static_cast<int>(plain.size()));
  return result > 0 || !failed(result);
}

void TlsStream::close() {
  if (established_ && trouble_.empty()) SSL_shutdown(ssl_.get());
  ERR_clear_error();
}

void TlsStream::take_outgoing(std::vector<std::byte>& sealed) {
  const size_t before = sealed.size(), more = BIO_ctrl_pending(outgoing_);
  if (more == 0) return;
  sealed.resize(before + more);
  BIO_read(outgoing_, sealed.data() + before, static_cast<int>(more));
}

// False when OpenSSL only waits for more bytes, or the client has said goodbye.
bool TlsStream::failed(int result) {
  switch (SSL_get_error(ssl_.get(), result)) {
    case SSL_ERROR_WANT_READ:
      return false;
    case SSL_ERROR_ZERO_RETURN:
      ended_ = true;
      return false;
    default:
      trouble_ = openssl_reason();
      return true;
  }
}

std::string TlsStream::certificate_name() const {
  const Certificate certificate(SSL_get1_peer_certificate(ssl_.get()), &X509_free);
  if (!certificate || SSL_get_verify_result(ssl_.get()) != X509_V_OK) return {};
  const Names names(
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(certificate.get(), NID_subject_alt_name, nullptr, nullptr)),
      &GENERAL_NAMES_free);
  for (const int kind : {GEN_URI, GEN_DNS})
    if (const ASN1_STRING* const name = alternative_name(names.get(), kind)) return printable(name);
  const ASN1_STRING* const name = common_name(certificate.get());
  return name ? printable(name) : std::string();
}

// --- the files
// -----------------------------------------------------------------------------------------------------------

TlsKeys::TlsKeys(TlsFiles files)
    : files_(std::move(files)),
      settled_({{files_.certificate, kCertificate}, {files_.key, kKey}, {files_.client_ca, kClientCa}}) {}

Result<std::unique_ptr<TlsKeys>> TlsKeys::load(TlsFiles files) {
  std::unique_ptr<TlsKeys> keys(new TlsKeys(std::move(files)));
  const auto texts = keys->settled_.read();
  if (!texts) return tl::unexpected(texts.error());
  if (Status ok = keys->take(*texts); !ok) return tl::unexpected(std::move(ok.error()));
  return keys;
}

Result<bool> TlsKeys::reload(SettledFiles::Time now) {
  const auto texts = settled_.look(now);
  if (!texts) return false;
  if (!*texts) return tl::unexpected(texts->error());
  if (Status ok = take(**texts); !ok) return tl::unexpected(std::move(ok.error()));
  return true;
}

Status TlsKeys::take(const SettledFiles::Texts& texts) {
  const Contents contents{texts[0], texts[1], texts[2]};
  auto made = make(contents);
  if (!made) return tl::unexpected(std::move(made.error()));
  if (!files_.client_ca.empty() && contents.client_ca.empty()) return invalid(kClientCa, "the file is empty");
  const MutexLock lock(mutex_);
  context_ = std::move(*made);
  return {};
}

std::vector<std::string> TlsKeys::exposed() const {
  std::vector<std::string> told;
  for (const auto& [path, secret] :
       {std::pair(&files_.certificate, false), std::pair(&files_.key, true), std::pair(&files_.client_ca, false)})
    if (std::string text = exposed_by_mode(*path, secret); !text.empty()) told.push_back(std::move(text));
  return told;
}

Result<TlsKeys::Context> TlsKeys::make(const Contents& contents) {
  const Context context(SSL_CTX_new(TLS_server_method()), &SSL_CTX_free);
  if (!context || !set_up(context.get()))
    return fail(ErrorCode::kInternal, kCertificate, "OpenSSL did not start: " + openssl_reason());
  if (Status ok = use_certificate(context.get(), contents.certificate); !ok)
    return tl::unexpected(std::move(ok.error()));
  if (Status ok = use_key(context.get(), contents.key); !ok) return tl::unexpected(std::move(ok.error()));
  if (contents.client_ca.empty()) return context;
  if (Status ok = use_client_ca(context.get(), contents.client_ca); !ok) return tl::unexpected(std::move(ok.error()));
  return context;
}

int64_t TlsKeys::expires_s() const {
  const MutexLock lock(mutex_);
  const X509* const certificate = SSL_CTX_get0_certificate(context_.get());
  std::tm end{};
  if (!certificate || ASN1_TIME_to_tm(X509_get0_notAfter(certificate), &end) != 1) return 0;
  return ::timegm(&end);
}

std::unique_ptr<TlsStream> TlsKeys::accept() const {
  Context context;
  {
    const MutexLock lock(mutex_);
    context = context_;
  }
  SSL* const ssl = SSL_new(context.get());
  return ssl ? std::make_unique<TlsStream>(ssl) : nullptr;
}

}  // namespace sightline
