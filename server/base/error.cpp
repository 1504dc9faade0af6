#include "server/base/error.h"

namespace sightline {

std::string_view to_string(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return "invalid argument";
    case ErrorCode::kNotFound:
      return "not found";
    case ErrorCode::kAlreadyExists:
      return "already exists";
    case ErrorCode::kFailedPrecondition:
      return "failed precondition";
    case ErrorCode::kResourceExhausted:
      return "resource exhausted";
    case ErrorCode::kUnsupported:
      return "unsupported";
    case ErrorCode::kDataLoss:
      return "data loss";
    case ErrorCode::kUnavailable:
      return "unavailable";
    case ErrorCode::kInternal:
      return "internal error";
  }
  return "unknown error";
}

std::string to_string(const Error& error) {
  std::string text(to_string(error.code));
  if (!error.field.empty()) text.append(": ").append(error.field);
  return text.append(": ").append(error.message);
}

std::string indexed(std::string_view list, size_t i) {
  return std::string(list).append("[").append(std::to_string(i)).append("]");
}

}  // namespace sightline
