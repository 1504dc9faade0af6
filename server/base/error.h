// Errors as values. Three kinds of trouble, three treatments:
//   misuse by our own code     -> assert
//   bad input from outside     -> an Error, returned to whoever sent it, naming the field
//   work that had to be reduced -> done, flagged and counted (see StepFlags in server/step/step.h)
#pragma once

#include <string>
#include <string_view>
#include <tl/expected.hpp>

namespace sightline {

// The meaning follows the gRPC status of the same name; `receive` maps one to the other.
enum class ErrorCode {
  kInvalidArgument,     // the value can never be right
  kNotFound,            // a name or id that does not exist
  kAlreadyExists,       // an id that is taken
  kFailedPrecondition,  // right in itself, wrong in this state (e.g. a delta against another revision)
  kResourceExhausted,   // over a stated limit
  kUnsupported,         // well formed, but outside what this build can do (e.g. a required glTF extension)
  kDataLoss,            // truncated or corrupt bytes
  kUnavailable,         // a device or file that cannot be reached now
  kInternal,            // our own fault
};

std::string_view to_string(ErrorCode code);

// `field` is a path in the vocabulary of whoever sent the data, e.g. "tick.transforms.rotation_xyzw[7]" or
// "meshes[2].primitives[0].indices"; empty when no single field is at fault. `message` is a sentence for a person.
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
