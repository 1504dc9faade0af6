#include "server/gate/credentials.h"

#include <utility>

namespace sightline {

Result<std::unique_ptr<Credentials>> Credentials::load(const CredentialFiles& files) {
  auto credentials = std::make_unique<Credentials>();
  if (!files.access.empty()) {
    auto access = Access::load(files.access);
    if (!access) return tl::unexpected(std::move(access.error()));
    credentials->access_ = std::move(*access);
  }
  if (!files.tls.certificate.empty()) {
    auto tls = TlsKeys::load(files.tls);
    if (!tls) return tl::unexpected(std::move(tls.error()));
    credentials->tls_ = std::move(*tls);
  }
  return credentials;
}

std::vector<Credentials::Change> Credentials::reload(SettledFiles::Time now) {
  std::vector<Change> changes;
  const auto note = [&](const char* what, FileCounts& counts, const Result<bool>& changed) {
    if (changed && !*changed) return;
    changed ? ++counts.taken_over : ++counts.refused;
    counts.current = changed.has_value();
    changes.push_back({what, changed ? std::nullopt : std::optional(changed.error())});
  };
  note("access file", access_file_, access_->reload(now));
  if (tls_) note("certificate", certificate_, tls_->reload(now));
  return changes;
}

std::vector<std::string> Credentials::exposed() const {
  std::vector<std::string> told;
  if (tls_) told = tls_->exposed();
  if (std::string text = access_->exposed(); !text.empty()) told.push_back(std::move(text));
  return told;
}

}  // namespace sightline
