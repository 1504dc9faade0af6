// The page without a session: HTML with its style and its program inside, made from client/page/ when the project is
// built.
#pragma once

#include <string_view>

namespace sightline {

// Holds {{TITLE}}, {{SESSION}} and {{DATA}} in this order, each once.
std::string_view page_template();

}  // namespace sightline
