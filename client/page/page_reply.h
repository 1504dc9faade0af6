// What a reply says, as a frame of a page: one reading of it for whoever fills a SessionPage.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/page/session_page.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// SessionPage::stages and SessionPage::flags of every page that is made of replies.
std::vector<std::string> page_stages();
std::vector<std::string> page_flags();

// All that the reply says but its candidates, out of the client's convention; `aspect` is the lens's. Its sights are
// as many as `targets`, found by id; those that it does not name are not present. Left open: aim points, true shares,
// latency and clearance.
PageFrame page_frame(const v1::CameraReply& reply, const Convention& convention, double aspect,
                     std::span<const PageTarget> targets);

// The candidates of a reply, if it has any; their masks follow the reply's own list of targets.
void add_page_cells(const v1::CameraReply& reply, const Convention& convention,
                    std::span<const PageTarget> targets, PageFrame& frame);

}  // namespace sightline
