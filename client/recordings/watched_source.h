// A source that shows on a progress bar how far into it its reader has come.
#pragma once

#include <algorithm>
#include <memory>
#include <string>

#include "client/base/progress_bar.h"
#include "server/record/byte_io.h"

namespace sightline {

// One thread at a time. The bar must outlive it. A reader that begins anew begins anew on the bar.
class WatchedSource final : public ByteSource {
 public:
  WatchedSource(std::shared_ptr<const ByteSource> source, ProgressBar& bar, std::string what)
      : source_(std::move(source)), bar_(bar), what_(std::move(what)) {}

  uint64_t size() const override { return source_->size(); }
  Status read_at(uint64_t offset, char* out, size_t count) const override {
    // Looks at the tail say nothing of how far the rest is.
    if (offset + count < size()) bar_.show(what_, offset, size());
    return source_->read_at(offset, out, count);
  }

 private:
  const std::shared_ptr<const ByteSource> source_;
  ProgressBar& bar_;
  const std::string what_;
};

// A file for a command: kNotFound, kUnavailable or kInvalidArgument as open_file_source says.
inline Result<std::shared_ptr<const ByteSource>> open_watched(const std::string& path, ProgressBar& bar,
                                                              const std::string& what) {
  auto source = open_file_source(path);
  if (!source) return tl::unexpected(std::move(source.error()));
  return std::make_shared<WatchedSource>(std::shared_ptr<const ByteSource>(std::move(*source)), bar, what);
}

}  // namespace sightline
