// A part of a recording as a recording that stands alone.
#pragma once

#include "client/recordings/recording.h"
#include "server/record/mcap_writer.h"

namespace sightline {

struct RecordingCut {
  uint64_t messages = 0;  // of the range
  uint64_t folded_ticks =
      0;  // that the first tick of the cut stands for; 0: it begins where the recording does
  uint64_t attachments = 0;
  McapLoss loss;  // of what was read: what should have been copied, and, before the range, folded
};

// Copies messages of all topics, of viewers and unknown ones too, with their own times, numbers and bytes. A range is
// one of places in the file: it begins with the first message that was logged at `start_s` or later and ends before the
// first after it that was logged at `end_s` or later, so that answers stay with their ticks.
//
// From 0 on the cut is the beginning of the recording, message for message. Else it begins with the opening, the newest
// shapes and still frames for viewers, a tick that stands for all before (server/record/session_snapshot.h), the ticks that were
// not answered yet, and a Gap when messages were missing by then; all ticks before the range are read for it. Attachments
// and metadata go with it; the part keeps its number; metadata `sightline.cut` say what it is cut from.
//
// Fails with kInvalidArgument (fields "start_s", "end_s") when nothing is in the range, as an attachment cannot be read,
// and as the sink fails. What was written by then is no file.
Result<RecordingCut> cut_recording(const Recording& recording, const RecordedRange& range, ByteSink& sink);

}  // namespace sightline
