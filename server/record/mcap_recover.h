// Makes a sound file of a damaged or unfinished one.
#pragma once

#include <functional>
#include <optional>

#include "server/record/byte_io.h"
#include "server/record/mcap_loss.h"
#include "server/record/mcap_writer.h"

namespace sightline {

struct McapRecovery {
  uint64_t chunks = 0;  // of the damaged file, that were whole
  uint64_t messages = 0;
  uint64_t attachments = 0;
  uint64_t metadata = 0;
  bool was_finished = false;  // nothing was missing behind what was read
  McapLoss loss;
};

using RecoveryNote = std::function<std::optional<mcap::Metadata>(const McapRecovery&)>;

// Copies to `sink` every message, attachment and metadata of `source` in whole chunks and records, in the order of the
// file, with their own times and sequences. Then it writes the summary, so that the copy is a finished file. A chunk is
// whole when its CRC is right; nothing is copied from other chunks. `options.profile` and `.library` are replaced by
// the values of the source. `note`, if given, is called at the end for metadata to add to the copy. Fails with
// kDataLoss when not even one record of the source is sound, and when the sink fails.
Result<McapRecovery> recover_mcap(const ByteSource& source, ByteSink& sink, McapLimits limits,
                                  McapWriterOptions options, const RecoveryNote& note = {});

}  // namespace sightline
