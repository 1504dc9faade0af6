// Copies a part of a recording into a recording of its own.
#pragma once

#include "client/recordings/recording.h"
#include "server/record/mcap_writer.h"

namespace sightline {

inline constexpr double kMostLeadS = 15.0;

struct RecordingCut {
  uint64_t messages = 0;        // of the range
  uint64_t snapshot_ticks = 0;  // in the snapshot tick at the head; 0: the cut begins where the recording does
  uint64_t attachments = 0;
  uint64_t lead_messages = 0;
  double lead_s = 0.0;  // how long before the range the lead begins; 0: there is none
  McapLoss loss;        // of the messages that were to be copied, or to go into the snapshot
};

// Copies messages of all topics, of viewers and unknown ones too, with their own times, numbers and bytes. The range is
// a stretch of the file. It begins with the first message that was logged at `start_s` or later. It ends before the
// first message after it that was logged at `end_s` or later. So replies stay with their ticks.
//
// With `start_s` 0 the cut is the beginning of the recording, message for message. Otherwise the cut begins with a
// head: the opening, the newest shapes and still frames for viewers, and a snapshot tick of all earlier ticks
// (server/record/session_snapshot.h). Ticks that were not answered yet follow, and a Gap when messages were missing by
// then. All ticks before the range are read for the snapshot tick. Attachments and metadata are copied, and the part
// keeps its number. The metadata `sightline.cut` names the source.
//
// A lead stands between the head and the range, so that the replies of the cut can be computed again to the bit. It
// holds the session's messages from the last StepMemory before the range on. Without a memory it begins with the
// session, when that is less than kMostLeadS before the range. Otherwise there is no lead, and the cut replays alike.
// Messages for viewers are not part of the lead.
//
// Fails with kInvalidArgument (fields "start_s", "end_s") when nothing is in the range, as an attachment cannot be
// read, and when the sink fails. The sink then holds no complete file.
Result<RecordingCut> cut_recording(const Recording& recording, const RecordedRange& range, ByteSink& sink);

}  // namespace sightline
