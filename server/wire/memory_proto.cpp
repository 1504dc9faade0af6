#include "server/wire/memory_proto.h"

#include "server/base/hash.h"

namespace sightline {
namespace {

uint64_t checksum_of(const std::string& bytes) {
  return hash64_bytes(std::as_bytes(std::span(bytes)));
}

}  // namespace

void memory_to_proto(const Session& session, v1::StepMemory& out) {
  out.mutable_state()->clear();
  session.write_memory(*out.mutable_state());
  out.set_sequence(session.sequence());
  out.set_layout(Session::memory_layout());
  out.set_checksum(checksum_of(out.state()));
}

Status resume_from_proto(const v1::StepMemory& memory, Session& session) {
  if (checksum_of(memory.state()) != memory.checksum()) return invalid("memory.checksum", "is not that of the state");
  return session.resume(memory.layout(), memory.state());
}

}  // namespace sightline
