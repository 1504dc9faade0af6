// Converts a reply to a frame of a page.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/page/session_page.h"
#include "server/session/convention.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// The values of SessionPage::stages and SessionPage::flags.
std::vector<std::string> page_stages();
std::vector<std::string> page_flags();

// Converts everything but the candidates, from the client's convention. `aspect` is the aspect of the lens. The frame
// has one sight for each of `targets`; targets that the reply lacks are not present. Aim points, true shares, latency
// and clearance are left unset.
PageFrame page_frame(const v1::CameraReply& reply, const Convention& convention, double aspect,
                     std::span<const PageTarget> targets);

// Adds the candidates of a reply, if it has any. Their masks follow the reply's own list of targets.
void add_page_cells(const v1::CameraReply& reply, const Convention& convention, std::span<const PageTarget> targets,
                    PageFrame& frame);

}  // namespace sightline
