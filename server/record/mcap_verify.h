// Checks an MCAP file against itself: every CRC, every index entry, every count, and the gaps in the numbers of its
// messages.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "server/record/byte_io.h"
#include "server/record/mcap_loss.h"

namespace sightline {

// The sequence numbers and the log times of one topic.
struct TopicVerdict {
  uint64_t messages = 0;
  uint64_t missing = 0;  // sequence numbers that are skipped; a publisher that does not count sends 0, which is no gap
  uint64_t out_of_order = 0;   // sequence or log time lower than in the message before
  uint64_t start_time_ns = 0;  // of the first and the last message, by log time
  uint64_t end_time_ns = 0;
  uint64_t longest_silence_ns = 0;  // between two that follow each other
};

struct McapVerdict {
  McapLoss loss;                    // what cannot be read at all
  McapLoss disagreements;           // readable, but the summary, an index or a CRC of the whole says otherwise
  bool finished = false;            // the data have an end
  bool summary_used = false;        // there is a summary, and it can be relied on
  std::vector<std::string> absent;  // McapInfo::absent: left out, which is no loss
  uint64_t chunks = 0;
  uint64_t chunks_without_crc = 0;
  std::map<std::string, TopicVerdict> topics;

  // Nothing is lost and all parts agree. Missing numbers and silences are the recorder's, not the file's: they do not
  // count.
  bool sound() const { return finished && loss.none() && disagreements.none(); }
};

// Reads all of the file once, and its summary. Fails only as McapReader::open does.
Result<McapVerdict> verify_mcap(const ByteSource& source, McapLimits limits);

}  // namespace sightline
