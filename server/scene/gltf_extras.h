// The part of a node's extras that Sightline reads: {"sightline": {"layers": 1, "opacity": 1, "occludes": true, "collides": true,
// "visible": true}}. Other members are for the players of the scene and are not read.
#pragma once

#include <nlohmann/json.hpp>

#include "server/base/error.h"
#include "server/scene/asset.h"

namespace sightline {

// `node_field` is e.g. "nodes[3]". kInvalidArgument with a field such as "nodes[3].extras.sightline.opacity".
Result<InstanceAttributes> read_instance_attributes(const nlohmann::json& node,
                                                    const std::string& node_field);

}  // namespace sightline
