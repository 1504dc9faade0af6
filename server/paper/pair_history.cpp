#include "server/paper/pair_history.h"

#include <algorithm>

namespace sightline {

// The ring grows with n, and keeps its newest frames when n changes.
PairHistory::Frame& PairHistory::next(int n) {
  const auto size = static_cast<size_t>(std::clamp(n, 1, kHistorySteps));
  if (frames_.size() > size || (frames_.size() < size && !frames_.empty())) {
    // the oldest first
    std::rotate(frames_.begin(), frames_.begin() + static_cast<ptrdiff_t>(newest_ + 1), frames_.end());
    if (frames_.size() > size) frames_.erase(frames_.begin(), frames_.end() - static_cast<ptrdiff_t>(size));
    newest_ = frames_.size() - 1;
  }
  if (frames_.size() < size) {
    frames_.emplace_back();
    newest_ = frames_.size() - 1;
  } else {
    newest_ = (newest_ + 1) % frames_.size();
  }
  return frames_[newest_];
}

void PairHistory::push_none(int n) {
  Frame& frame = next(n);
  frame.target_ids.clear(), frame.links.clear(), frame.depth_m.clear();
}

void PairHistory::push(const PairChain& chain, std::span<const DepthMap> maps, std::span<const uint64_t> target_ids,
                       double relative_bias, int n) {
  Frame& frame = next(n);
  frame.target_ids.assign(target_ids.begin(), target_ids.end());
  frame.links.assign(chain.links.begin(), chain.links.end());
  frame.jitter = maps.front().view.jitter;
  frame.slack = 1.0 + relative_bias;
  frame.depth_m.clear();
  for (size_t target = 0; target < target_ids.size(); ++target)
    for (int y = 0; y < maps[target].view.height; ++y)
      for (int x = 0; x < maps[target].view.width; ++x)
        frame.depth_m.push_back(std::min(maps[target].depth_at(x, y), kBeyondAllM));
}

// False if the point has no coordinates in one of the volumes. All maps of a frame are of one size, and look along the
// z axis of a volume.
bool PairHistory::look_up(const Frame& frame, const glm::dvec3& point_m, uint32_t& visible) {
  visible = 0;
  if (frame.links.empty()) return false;
  const auto sees = [&](uint32_t target, const PairVolume& volume, int column, int row) {
    const auto r = static_cast<size_t>(volume.resolution);
    const double depth_m = frame.depth_m[target * r * r + static_cast<size_t>(row) * r + static_cast<size_t>(column)];
    if (glm::dot(point_m - volume.a_m, volume.world_from_volume[2]) <= depth_m * frame.slack) visible |= 1u << target;
  };
  for (size_t k = 0; k < frame.links.size(); ++k) {
    const ChainLink& link = frame.links[k];
    const auto texels = nearest_texels(link.volume, point_m, frame.jitter);
    if (!texels) return false;
    if (k == 0) sees(link.from, link.volume, link.volume.resolution - 1 - texels->z, texels->y);
    sees(link.to, link.volume, texels->x, texels->y);
  }
  return true;
}

void PairHistory::filter(std::span<const glm::dvec3> position_m, std::span<const uint32_t> visible_now,
                         std::span<const uint64_t> target_ids, uint32_t steered, const FilterSettings& settings,
                         std::vector<uint32_t>& filtered) {
  const size_t steps = std::min(frames_.size(), static_cast<size_t>(std::max(settings.n, 1)));
  const auto frame_before = [&](size_t k) -> const Frame& {
    return frames_[(newest_ + frames_.size() - k) % frames_.size()];
  };
  index_in_frame_.resize(std::max(index_in_frame_.size(), steps));
  for (size_t k = 1; k < steps; ++k) {
    const std::vector<uint64_t>& then = frame_before(k).target_ids;
    index_in_frame_[k].assign(target_ids.size(), -1);
    for (size_t i = 0; i < target_ids.size(); ++i)
      if (const auto at = std::find(then.begin(), then.end(), target_ids[i]); at != then.end())
        index_in_frame_[k][i] = static_cast<int>(at - then.begin());
  }
  filtered.assign(visible_now.begin(), visible_now.end());
  for (size_t i = 0; i < position_m.size(); ++i) {
    records_.assign(target_ids.size(), VisibilityRecord{0, 1});
    for (size_t t = 0; t < records_.size(); ++t) records_[t].visible = visible_now[i] >> t & 1u;
    for (size_t k = 1; k < steps; ++k) {
      uint32_t visible = 0;
      if (!look_up(frame_before(k), position_m[i], visible)) continue;
      for (size_t t = 0; t < records_.size(); ++t) {
        const int then = index_in_frame_[k][t];
        if (then < 0) continue;
        records_[t].known |= uint64_t{1} << k;
        records_[t].visible |= uint64_t{visible >> then & 1u} << k;
      }
    }
    filtered[i] = (visible_now[i] & ~steered) |
                  joint_state(records_, steered, settings.n, settings.alpha).visible_targets;
  }
}

}  // namespace sightline
