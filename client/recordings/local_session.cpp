#include "client/recordings/local_session.h"

#include <utility>

#include "server/wire/from_proto.h"
#include "server/wire/memory_proto.h"
#include "server/wire/to_proto.h"

namespace sightline {

Result<std::string> LocalWorld::bring(std::span<const std::byte> file) {
  auto asset = scenes.add_uploaded(file);
  if (!asset) return tl::unexpected(std::move(asset.error()));
  brought.push_back(*asset);
  return to_hex((*asset)->hash);
}

Result<std::unique_ptr<LocalSession>> LocalSession::open(const v1::OpenSession& request, LocalWorld& world,
                                                         StageClock clock) {
  std::vector<std::string> warnings;
  auto options = session_options_from_proto(request, SceneSource{world.scenes, world.geometry}, warnings);
  if (!options) return tl::unexpected(std::move(options.error()));
  options->extents = &world.extents;
  auto session = Session::open(std::move(*options), world.sampler.make_sampler(), std::move(clock));
  if (!session) return tl::unexpected(std::move(session.error()));
  std::unique_ptr<LocalSession> local(new LocalSession(world, std::move(*session)));
  local->wanted_ = local->session_->diagnostics();
  opened_to_proto(*local->session_, local->opened_);
  local->opened_.set_sampler(world.sampler.kind());
  for (std::string& warning : warnings) local->opened_.add_warnings(std::move(warning));
  return local;
}

bool LocalSession::apply(const v1::Tick& tick, v1::TickError& rejection) {
  auto input = tick_from_proto(tick, *session_, SceneSource{world_.scenes, world_.geometry});
  const Status applied = input ? session_->apply(*input) : tl::unexpected(std::move(input.error()));
  if (!applied) tick_error_to_proto(applied.error(), tick.sequence(), &session_->mirror(), rejection);
  return applied.has_value();
}

Status LocalSession::step(int quality_level, v1::CameraReply& reply) {
  const auto answer = session_->step(quality_level);
  if (!answer) return tl::unexpected(answer.error());
  camera_reply_to_proto(*answer, *session_, wanted_, reply);
  return {};
}

void LocalSession::write_memory(v1::StepMemory& memory) const {
  memory_to_proto(*session_, memory);
}

Status LocalSession::resume(const v1::StepMemory& memory) {
  return resume_from_proto(memory, *session_);
}

}  // namespace sightline
