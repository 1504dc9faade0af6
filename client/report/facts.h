// What a recording is, in words: for the head of its page.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "client/recordings/recording.h"
#include "client/report/digest.h"

namespace sightline {

// Name and value each.
std::vector<std::pair<std::string, std::string>> recording_facts(const Recording& recording,
                                                                 const RecordingDigest& digest);

// What a reader has to know of the file before believing what is made of it, a sentence each: that it is unfinished,
// damaged or only a part, that messages are missing, that frames were left out.
std::vector<std::string> recording_notices(const Recording& recording, const RecordingDigest& digest);

}  // namespace sightline
