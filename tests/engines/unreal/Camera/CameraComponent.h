#pragma once
#include "CoreMinimal.h"

class UCameraComponent {
 public:
  FVector GetComponentLocation() const;
  FQuat GetComponentQuat() const;
  void SetWorldLocationAndRotation(FVector location, const FQuat& rotation);
  void SetFieldOfView(float degrees);
};
