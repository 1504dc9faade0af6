// As much of Unreal's declarations as the code of client/engines/unreal.md uses, so that a compiler can check that
// code.
#pragma once

#include <cstdint>
#include <vector>

#define check(expression) ((void)(expression))  // the engine has these macros, and headers of others must survive them
#define verify(expression) ((void)(expression))
#define THIRD_PARTY_INCLUDES_START
#define THIRD_PARTY_INCLUDES_END

using uint32 = std::uint32_t;
using uint64 = unsigned long long;
using int32 = std::int32_t;

struct FVector {
  FVector(double x, double y, double z) : X(x), Y(y), Z(z) {}
  FVector operator+(const FVector& other) const { return {X + other.X, Y + other.Y, Z + other.Z}; }
  FVector operator-(const FVector& other) const { return {X - other.X, Y - other.Y, Z - other.Z}; }
  FVector operator/(double divisor) const { return {X / divisor, Y / divisor, Z / divisor}; }
  static double Dist(const FVector& a, const FVector& b);
  static const FVector UpVector;
  double X, Y, Z;
};
struct FQuat {
  FQuat(double x, double y, double z, double w) : X(x), Y(y), Z(z), W(w) {}
  FQuat operator*(const FQuat& other) const;
  FQuat Inverse() const;
  FVector RotateVector(FVector vector) const;
  static FQuat FindBetweenVectors(const FVector& from, const FVector& to);
  double X, Y, Z, W;
};
struct FTransform {
  FTransform(const FQuat& rotation, const FVector& translation);
  FVector GetLocation() const;
  FQuat GetRotation() const;
};
struct FName {};
template <typename T>
struct TArray : std::vector<T> {
  int32 Num() const { return static_cast<int32>(this->size()); }
};
