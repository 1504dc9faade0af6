// Animations to channels (glTF 2.0 section 3.11).
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "server/scene/gltf_accessor.h"
#include "server/scene/gltf_document.h"

namespace sightline {
namespace {

std::optional<AssetChannel::Path> path_of(const std::string& path) {
  if (path == "translation") return AssetChannel::Path::kTranslation;
  if (path == "rotation") return AssetChannel::Path::kRotation;
  if (path == "scale") return AssetChannel::Path::kScale;
  return std::nullopt;
}

std::optional<AssetChannel::Interpolation> interpolation_of(const std::string& name) {
  if (name == "LINEAR" || name.empty()) return AssetChannel::Interpolation::kLinear;
  if (name == "STEP") return AssetChannel::Interpolation::kStep;
  if (name == "CUBICSPLINE") return AssetChannel::Interpolation::kCubicSpline;
  return std::nullopt;
}

Status check_times(const std::vector<float>& times_s, const std::string& field) {
  float last = -1.0f;
  for (size_t i = 0; i < times_s.size(); ++i) {
    if (!std::isfinite(times_s[i]) || times_s[i] < 0.0f || !(times_s[i] > last))
      return invalid(gltf_path(field.c_str(), i), "times must be finite, not negative and rise strictly");
    last = times_s[i];
  }
  return {};
}

// Finite, and for rotations long enough to have a direction (tangents may be anything finite).
Status check_values(const AssetChannel& channel, const std::string& field) {
  for (size_t i = 0; i < channel.values.size(); ++i)
    if (!(std::abs(channel.values[i]) <= 1e9f))
      return invalid(gltf_path(field.c_str(), i), "must be finite and within 1e9");
  if (channel.path != AssetChannel::Path::kRotation) return {};
  const bool cubic = channel.interpolation == AssetChannel::Interpolation::kCubicSpline;
  const size_t step = cubic ? 12 : 4;
  for (size_t i = cubic ? 4 : 0; i + 4 <= channel.values.size(); i += step) {
    const float* q = &channel.values[i];
    if (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] < 1e-12f)
      return invalid(gltf_path(field.c_str(), i / 4), "must be a unit quaternion");
  }
  return {};
}

Status read_keys(GltfDocument& document, const tinygltf::AnimationSampler& sampler, const std::string& field,
                 AssetChannel& channel) {
  const auto& accessors = document.model.accessors;
  const size_t keys = accessors[static_cast<size_t>(sampler.input)].count;
  const size_t width = channel.path == AssetChannel::Path::kRotation ? 4 : 3;
  const size_t per_key = channel.interpolation == AssetChannel::Interpolation::kCubicSpline ? 3 : 1;
  if (accessors[static_cast<size_t>(sampler.output)].count != keys * per_key)
    return invalid(field + ".output", "must have " + std::to_string(keys * per_key) + " elements");
  if (const Status s = GltfBudget::take(document.budget.animation_values, keys * (1 + width * per_key), field,
                                        "animation values");
      !s)
    return s;
  auto times = read_gltf_floats(document, sampler.input, 1, GltfComponents::kFloatOnly, field + ".input");
  if (!times) return tl::unexpected(std::move(times.error()));
  auto values = read_gltf_floats(document, sampler.output, static_cast<int>(width),
                                 width == 4 ? GltfComponents::kFloatOrNormalized : GltfComponents::kFloatOnly,
                                 field + ".output");
  if (!values) return tl::unexpected(std::move(values.error()));
  channel.times_s = std::move(*times);
  channel.values = std::move(*values);
  if (const Status s = check_times(channel.times_s, field + ".input"); !s) return s;
  return check_values(channel, field + ".output");
}

// An accessor may have no data in the file: all its numbers are zero then. That makes no keys.
bool has_data(const tinygltf::Model& model, int accessor) {
  const tinygltf::Accessor& source = model.accessors[static_cast<size_t>(accessor)];
  return source.bufferView >= 0 || source.sparse.isSparse;
}

// Why a channel is not played, or nothing.
std::optional<std::string> reason_to_skip(const tinygltf::Model& model, const tinygltf::AnimationSampler& sampler,
                                          const tinygltf::AnimationChannel& channel, int asset_node,
                                          const SceneAsset& asset) {
  if (channel.target_path == "weights") return "morph targets stay at rest";
  if (!path_of(channel.target_path)) return "target.path \"" + channel.target_path.substr(0, 40) + "\" is not known";
  if (asset_node < 0) return "the node is not part of the scene";
  if (!asset.nodes[static_cast<size_t>(asset_node)].decomposed) return "the node's matrix shears or flattens";
  if (!has_data(model, sampler.input) || !has_data(model, sampler.output)) return "its keys have no data in the file";
  return std::nullopt;
}

class AnimationReader {
 public:
  AnimationReader(GltfDocument& document, const std::vector<int>& asset_node_of, const SceneAsset& asset)
      : document_(document), asset_node_of_(asset_node_of), asset_(asset) {}

  Result<AssetAnimation> read(const tinygltf::Animation& source, const std::string& field) {
    AssetAnimation animation;
    animation.name = source.name;
    std::set<std::pair<int, AssetChannel::Path>> seen;
    for (size_t i = 0; i < source.channels.size(); ++i) {
      if (document_.work.ends(64)) return tl::unexpected(document_.work.limit()->error());
      const std::string channel_field = field + "." + gltf_path("channels", i);
      const int node = asset_node_of_[static_cast<size_t>(source.channels[i].target_node)];
      if (const auto reason = reason_to_skip(document_.model,
                                             source.samplers[static_cast<size_t>(source.channels[i].sampler)],
                                             source.channels[i], node, asset_)) {
        document_.warnings.add(channel_field + ": ignored, " + *reason);
        continue;
      }
      auto channel = read_channel(source, source.channels[i], node, field);
      if (!channel) return tl::unexpected(std::move(channel.error()));
      if (!seen.emplace(node, channel->path).second)
        return invalid(channel_field + ".target", "another channel has the same target");
      animation.duration_s = std::max(animation.duration_s, static_cast<double>(channel->times_s.back()));
      animation.channels.push_back(std::move(*channel));
    }
    return animation;
  }

 private:
  Result<AssetChannel> read_channel(const tinygltf::Animation& source, const tinygltf::AnimationChannel& target,
                                    int node, const std::string& field) {
    const auto sampler_index = static_cast<size_t>(target.sampler);
    const std::string sampler_field = field + "." + gltf_path("samplers", sampler_index);
    const tinygltf::AnimationSampler& sampler = source.samplers[sampler_index];
    const auto interpolation = interpolation_of(sampler.interpolation);
    if (!interpolation) return invalid(sampler_field + ".interpolation", "must be STEP, LINEAR or CUBICSPLINE");
    AssetChannel channel;
    channel.node = node;
    channel.path = *path_of(target.target_path);
    channel.interpolation = *interpolation;
    if (const Status s = read_keys(document_, sampler, sampler_field, channel); !s) return tl::unexpected(s.error());
    return channel;
  }

  GltfDocument& document_;
  const std::vector<int>& asset_node_of_;
  const SceneAsset& asset_;
};

}  // namespace

Status read_gltf_animations(GltfDocument& document, const std::vector<int>& asset_node_of, SceneAsset& asset) {
  AnimationReader reader(document, asset_node_of, asset);
  for (size_t i = 0; i < document.model.animations.size(); ++i) {
    auto animation = reader.read(document.model.animations[i], gltf_path("animations", i));
    if (!animation) return tl::unexpected(std::move(animation.error()));
    asset.animations.push_back(std::move(*animation));
  }
  return {};
}

}  // namespace sightline
