// Errors as values. There are three kinds, each with its treatment:
//   misuse by our own code      -> assert
//   invalid input from outside  -> an Error that names the field, returned to the sender
//   work that had to be reduced -> done, flagged and counted (StepFlags in server/step/step.h)
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace sightline {

// The meaning follows the gRPC status of the same name; kUnsupported is UNIMPLEMENTED. The `wire` stage maps one to the
// other.
enum class ErrorCode {
  kInvalidArgument,     // the value is invalid in any state
  kNotFound,            // a name or id that does not exist
  kAlreadyExists,       // an id that is taken
  kFailedPrecondition,  // valid, but not in this state (e.g. a delta against another revision)
  kResourceExhausted,   // over a stated limit
  kUnsupported,         // well formed, but outside what this build can do (e.g. a required glTF extension)
  kDataLoss,            // truncated or corrupt bytes
  kUnavailable,         // a device or file that cannot be reached now
  kInternal,            // a defect of this program
};

std::string_view to_string(ErrorCode code);

// `field` is a path in the sender's data, e.g. "tick.transforms.rotations[7]" or "meshes[2].primitives[0].indices";
// empty when no single field is at fault. `message` is for people.
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string field;
  std::string message;
};

// "invalid argument: tick.dt_s: must be positive, got -1"
std::string to_string(const Error& error);

// "list[7]": the field path of one element.
std::string indexed(std::string_view list, size_t i);

template <typename T>
using Result = tl::expected<T, Error>;
using Status = tl::expected<void, Error>;

inline tl::unexpected<Error> fail(ErrorCode code, std::string field, std::string message) {
  return tl::unexpected<Error>(Error{code, std::move(field), std::move(message)});
}
inline tl::unexpected<Error> invalid(std::string field, std::string message) {
  return fail(ErrorCode::kInvalidArgument, std::move(field), std::move(message));
}

}  // namespace sightline
