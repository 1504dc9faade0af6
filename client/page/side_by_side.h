// Two pages of sessions as one page, left and right. Both show the same moment: where one goes, the other follows.
#pragma once

#include <string>
#include <string_view>

namespace sightline {

// Both are whole pages of session_page(). When the clocks of the two sessions have a time in common, they are shown at
// the same game time, otherwise at the same time since their beginnings. The result opens from disk without a network,
// as they do.
std::string side_by_side_page(std::string_view title, std::string_view left, std::string_view right);

}  // namespace sightline
