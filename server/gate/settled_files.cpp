#include "server/gate/settled_files.h"

#include <span>
#include <utility>

#include "server/gate/small_file.h"

namespace sightline {
namespace {

ContentHash hash_of(const std::string& text) {
  return hash_bytes(std::as_bytes(std::span(text)));
}

// What changes when the file is written again or replaced, also with equal contents.
std::string identity_of(const struct stat& state) {
  std::string text;
  for (const auto part : {static_cast<long long>(state.st_dev), static_cast<long long>(state.st_ino),
                          static_cast<long long>(state.st_size), static_cast<long long>(state.st_mtim.tv_sec),
                          static_cast<long long>(state.st_mtim.tv_nsec), static_cast<long long>(state.st_ctim.tv_sec),
                          static_cast<long long>(state.st_ctim.tv_nsec)})
    text.append(std::to_string(part)).push_back(' ');
  return text;
}

}  // namespace

SettledFiles::Look SettledFiles::look_at_all() const {
  Texts texts;
  std::string contents, states;
  bool being_written = false;
  for (const File& file : files_) {
    if (file.path.empty()) {
      texts.emplace_back();
      continue;
    }
    auto found = look_at_small_file(file.path, file.flag);
    if (!found) {
      const ContentHash hash = hash_of(to_string(found.error()));
      return {tl::unexpected(std::move(found.error())), hash, hash, being_written};
    }
    contents.append(std::to_string(found->text.size())).append(" ").append(found->text);
    states.append(identity_of(found->state));
    being_written |= found->being_written;
    texts.push_back(std::move(found->text));
  }
  return {std::move(texts), hash_of(contents), hash_of(contents + states), being_written};
}

Result<SettledFiles::Texts> SettledFiles::read() {
  Look look = look_at_all();
  returned_ = look.contents;
  changing_.reset();
  return std::move(look.texts);
}

std::optional<Result<SettledFiles::Texts>> SettledFiles::look(Time now) {
  Look look = look_at_all();
  if (look.contents == returned_) {
    changing_.reset();
    return std::nullopt;
  }
  if (!changing_ || changing_->state != look.state) changing_ = Change{look.state, now};
  if (now - changing_->since < (look.being_written ? kPatience : kSettle)) return std::nullopt;
  changing_.reset();
  returned_ = look.contents;
  return std::move(look.texts);
}

}  // namespace sightline
