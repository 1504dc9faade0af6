// libFuzzer runs every reader of MCAP on arbitrary bytes. tests/fuzz.sh builds and runs this program with clang;
// the normal build runs it on its kept corpus.
#include <cstdint>
#include <cstdlib>

#include "server/record/mcap_reader.h"
#include "server/record/mcap_recover.h"
#include "server/record/mcap_verify.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace sightline;
  const MemorySource source({reinterpret_cast<const char*>(data), size});
  // The limits are small: an input that gets past one exceeds the memory limit of the run, and so is found.
  const McapLimits limits{.max_chunk_bytes = 1 << 20,
                          .max_record_bytes = 1 << 20,
                          .max_attachment_bytes = 1 << 20,
                          .max_summary_bytes = 1 << 20,
                          .max_definition_bytes = 1 << 20};
  (void)verify_mcap(source, limits);
  if (const Result<McapReader> reader = McapReader::open(source, limits)) {
    uint64_t messages = 0;
    const McapReadReport report = reader->read({}, [&](const McapMessage&) { return ++messages > 0; });
    if (report.messages != messages) std::abort();
    for (const mcap::AttachmentIndex& index : reader->info().attachments) (void)reader->attachment(index);
    for (const mcap::MetadataIndex& index : reader->info().metadata) (void)reader->metadata(index);
  }
  MemorySink sink;
  const Result<McapRecovery> done = recover_mcap(source, sink, limits, {});
  if (!done) return 0;
  // A recovered file is sound and has as many messages as reported.
  const MemorySource copy(sink.bytes());
  const Result<McapVerdict> verdict = verify_mcap(copy, {});
  if (!verdict || !verdict->sound()) std::abort();
  uint64_t messages = 0;
  for (const auto& [_, topic] : verdict->topics) messages += topic.messages;
  if (messages != done->messages) std::abort();
  return 0;
}
