#include "server/gate/access.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <pwd.h>

#include <algorithm>
#include <charconv>
#include <sstream>
#include <utility>

#include "server/gate/small_file.h"

namespace sightline {
namespace {

constexpr char kField[] = "--access-file";
constexpr size_t kShortestSecret = 16, kLongestSecret = 512;
constexpr std::string_view kDigestMark = "sha256:";
constexpr char kToken[] = "token", kCertificate[] = "certificate", kUser[] = "user";
constexpr std::string_view kTokenName = "token ", kCertificateName = "certificate ", kUserName = "uid ";

std::optional<Role> role_from(std::string_view text) {
  if (text == "control") return Role::kControl;
  if (text == "observe") return Role::kObserve;
  if (text == "admin") return Role::kAdmin;
  return std::nullopt;
}

bool printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < 127; });
}

std::optional<unsigned> number_from(std::string_view text) {
  unsigned number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

// The numeric id of a user as text. "*" stays.
std::optional<std::string> user_id(const std::string& name) {
  if (name == "*") return name;
  if (const auto number = number_from(name)) return std::to_string(*number);
  const passwd* const user = ::getpwnam(name.c_str());
  if (!user) return std::nullopt;
  return std::to_string(user->pw_uid);
}

// A `#` within a word belongs to it.
std::string_view without_comment(std::string_view line) {
  for (size_t at = line.find('#'); at != std::string_view::npos; at = line.find('#', at + 1))
    if (at == 0 || line[at - 1] == ' ' || line[at - 1] == '\t') return line.substr(0, at);
  return line;
}

// "line 3: ..."
Error with_line(Error error, int number) {
  error.message.insert(0, "line " + std::to_string(number) + ": ");
  return error;
}

// The end of a message about what is there twice.
std::string first_in(int line) {
  return "; it is already in line " + std::to_string(line);
}

}  // namespace

bool Caller::may(Need need) const {
  if (!role || role == Role::kAdmin || need == Need::kAnyRole) return true;
  return need == Need::kControl ? role == Role::kControl : role == Role::kObserve;
}

// --- the list
// -----------------------------------------------------------------------------------------------------------

Result<AccessList> AccessList::parse(std::string_view text) {
  AccessList list;
  std::istringstream lines{std::string(text)};
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (Status ok = list.read_line(without_comment(line), number); !ok)
      return tl::unexpected(with_line(std::move(ok.error()), number));
  }
  return list;
}

Status AccessList::read_line(std::string_view line, int number) {
  std::istringstream words{std::string(line)};
  std::string kind, name, role_name, secret, more;
  words >> kind >> name >> role_name >> secret >> more;
  if (kind.empty()) return {};
  if (kind != kToken && kind != kCertificate && kind != kUser)
    return invalid(kField, "must begin with token, certificate or user");
  const auto role = role_from(role_name);
  if (!role) return invalid(kField, "the third word must be control, observe or admin");
  if (!printable(name)) return invalid(kField, "the name may have printable ASCII characters only");
  const bool words_fit = kind == kToken ? !secret.empty() && more.empty() : secret.empty();
  if (!words_fit)
    return invalid(kField,
                   kind == kToken ? "a token needs a name, a role and one secret" : "nothing may follow the role");
  if (kind == kToken) return add_token(name, *role, secret, number);
  auto key = kind == kUser ? user_id(name) : std::optional(name);
  if (!key) return invalid(kField, "this machine has no user \"" + name + "\"");
  const auto [found, added] = (kind == kUser ? users_ : certificates_).emplace(std::move(*key), Named{*role, number});
  return added ? Status{} : invalid(kField, "the name is there twice" + first_in(found->second.line));
}

Status AccessList::add_token(const std::string& name, Role role, const std::string& secret, int number) {
  for (const Token& known : tokens_)
    if (known.name == name) return invalid(kField, "the name is there twice" + first_in(known.line));
  Token token{name, role, {}, number};
  if (std::string_view(secret).starts_with(kDigestMark)) {
    const std::string_view hex = std::string_view(secret).substr(kDigestMark.size());
    if (hex.size() != 2 * token.digest.size()) return invalid(kField, "sha256: needs 64 hexadecimal digits");
    for (size_t i = 0; i < token.digest.size(); ++i) {
      const auto [end, error] = std::from_chars(hex.data() + 2 * i, hex.data() + 2 * i + 2, token.digest[i], 16);
      if (error != std::errc() || end != hex.data() + 2 * i + 2)
        return invalid(kField, "sha256: needs 64 hexadecimal digits");
    }
  } else {
    if (secret.size() < kShortestSecret || secret.size() > kLongestSecret || !printable(secret))
      return invalid(kField, "a secret has 16 to 512 printable ASCII characters");
    const auto digest = digest_of(secret);
    if (!digest) return fail(ErrorCode::kInternal, kField, "OpenSSL computes no SHA-256");
    token.digest = *digest;
    tells_secrets_ = true;
  }
  // Whose call it is, and with which role, could not be said.
  for (const Token& known : tokens_)
    if (known.digest == token.digest)
      return invalid(kField, "the secret is there twice" + first_in(known.line) + ", for \"" + known.name + '"');
  tokens_.push_back(std::move(token));
  return {};
}

// The role of a name, or of everyone.
std::optional<Role> AccessList::role_in(const NamedRoles& roles, const std::string& name) {
  for (const std::string& key : {name, std::string("*")})
    if (const auto found = roles.find(key); found != roles.end()) return found->second.role;
  return std::nullopt;
}

std::optional<AccessList::Digest> AccessList::digest_of(std::string_view secret) {
  Digest digest;
  if (EVP_Digest(secret.data(), secret.size(), digest.data(), nullptr, EVP_sha256(), nullptr) != 1) return std::nullopt;
  return digest;
}

// All tokens are compared, each in constant time. What is compared are digests, so that even the place of a difference
// would say nothing about the secret.
std::optional<Caller> AccessList::find_token(std::string_view token) const {
  if (token.size() > kLongestSecret) return std::nullopt;
  const auto digest = digest_of(token);
  if (!digest) return std::nullopt;
  const Token* found = nullptr;
  for (const Token& known : tokens_)
    if (CRYPTO_memcmp(known.digest.data(), digest->data(), digest->size()) == 0) found = &known;
  if (!found) return std::nullopt;
  return Caller{std::string(kTokenName) + found->name, found->role};
}

std::optional<Caller> AccessList::find_certificate(const std::string& name) const {
  const auto role = name.empty() ? std::nullopt : role_in(certificates_, name);
  if (!role) return std::nullopt;
  return Caller{std::string(kCertificateName) + name, role};
}

std::optional<Caller> AccessList::find_user(unsigned id) const {
  const auto role = role_in(users_, std::to_string(id));
  if (!role) return std::nullopt;
  return Caller{std::string(kUserName) + std::to_string(id), role};
}

std::optional<Role> AccessList::role_of(std::string_view caller) const {
  if (caller.starts_with(kCertificateName))
    return role_in(certificates_, std::string(caller.substr(kCertificateName.size())));
  if (caller.starts_with(kUserName)) return role_in(users_, std::string(caller.substr(kUserName.size())));
  for (const Token& token : tokens_)
    if (caller.starts_with(kTokenName) && caller.substr(kTokenName.size()) == token.name) return token.role;
  return std::nullopt;
}

// --- decisions
// ----------------------------------------------------------------------------------------------------------

Result<std::unique_ptr<Access>> Access::load(const std::string& path) {
  auto access = std::make_unique<Access>();
  access->path_ = path;
  access->file_ = SettledFiles({{path, kField}});
  const auto texts = access->file_.read();
  if (!texts) return tl::unexpected(texts.error());
  if (Status ok = access->take(texts->front()); !ok) return tl::unexpected(std::move(ok.error()));
  return access;
}

Result<bool> Access::reload(SettledFiles::Time now) {
  if (path_.empty()) return false;
  const auto texts = file_.look(now);
  if (!texts) return false;
  if (!*texts) return tl::unexpected(texts->error());
  if (Status ok = take((*texts)->front()); !ok) return tl::unexpected(std::move(ok.error()));
  return true;
}

Status Access::take(const std::string& text) {
  auto list = AccessList::parse(text);
  if (!list) return tl::unexpected(std::move(list.error()));
  if (list->empty()) return invalid(kField, path_ + ": must name at least one token, certificate or user");
  const MutexLock lock(mutex_);
  list_ = std::make_shared<const AccessList>(std::move(*list));
  return {};
}

std::string Access::exposed() const {
  const auto known = list();
  return known ? exposed_by_mode(path_, known->tells_secrets()) : "";
}

std::shared_ptr<const AccessList> Access::list() const {
  const MutexLock lock(mutex_);
  return list_;
}

tl::expected<Caller, Refusal> Access::identify(const Peer& peer, std::optional<std::string_view> token,
                                               Need need) const {
  auto caller = find(peer, token);
  if (caller && !caller->may(need))
    caller = tl::unexpected(Refusal{true, caller->name + " has not the role that this call needs: " +
                                              (need == Need::kControl ? "control" : "observe")});
  if (!caller) ++refused_;
  return caller;
}

tl::expected<Caller, Refusal> Access::find(const Peer& peer, std::optional<std::string_view> token) const {
  const auto known = list();
  if (!known)
    return Caller{peer.certificate.empty() ? peer.client : std::string(kCertificateName) + peer.certificate,
                  std::nullopt};
  if (token) {
    if (!peer.confidential) return tl::unexpected(Refusal{false, "a token is accepted only over TLS or a unix socket"});
    if (auto caller = known->find_token(*token)) return *caller;
    return tl::unexpected(Refusal{false, "the token is not known"});
  }
  if (!peer.certificate.empty()) {
    if (auto caller = known->find_certificate(peer.certificate)) return *caller;
    return tl::unexpected(
        Refusal{false, "the certificate of " + peer.certificate + " is not in the access file, and no token was sent"});
  }
  if (peer.user) {
    if (auto caller = known->find_user(*peer.user)) return *caller;
    return tl::unexpected(
        Refusal{false, "the user " + std::to_string(*peer.user) + " is not in the access file, and no token was sent"});
  }
  return tl::unexpected(Refusal{false, "a token is needed, in the metadata `authorization: Bearer TOKEN`"});
}

bool Access::still_controls(const std::string& name) const {
  const auto known = list();
  if (!known) return true;
  const auto role = known->role_of(name);
  return role && Caller{name, role}.may(Need::kControl);
}

}  // namespace sightline
