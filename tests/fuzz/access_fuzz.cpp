// libFuzzer reads arbitrary access files. tests/fuzz.sh builds and runs this program with clang; the normal build runs
// it on its kept corpus.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "server/gate/access.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto list = AccessList::parse(text);
  if (!list) {
    // An error names the flag and the line.
    if (list.error().field != "--access-file" || !list.error().message.starts_with("line ")) std::abort();
    return 0;
  }
  // No file lets in a caller without a secret or a name.
  if (list->find_token({}) || list->find_certificate({})) std::abort();
  // A comment at its end changes nothing.
  if (!AccessList::parse(std::string(text) + "\n# end")) std::abort();
  return 0;
}
