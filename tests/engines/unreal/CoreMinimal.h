// As much of Unreal's declarations as the code of client/engines/unreal.md uses, so that a compiler can check that code.
#pragma once

#include <cstdint>
#include <vector>

#define check(expression) ((void)(expression))  // the engine has these macros, and headers of others must survive them
#define verify(expression) ((void)(expression))
#define THIRD_PARTY_INCLUDES_START
#define THIRD_PARTY_INCLUDES_END

using uint32 = std::uint32_t;
using uint64 = unsigned long long;

struct FVector {
  FVector(double x, double y, double z) : X(x), Y(y), Z(z) {}
  FVector operator+(const FVector& other) const { return {X + other.X, Y + other.Y, Z + other.Z}; }
  double X, Y, Z;
};
struct FQuat {
  FQuat(double x, double y, double z, double w) : X(x), Y(y), Z(z), W(w) {}
  double X, Y, Z, W;
};
template <typename T>
using TArray = std::vector<T>;
