#pragma once
#include "CoreMinimal.h"

class UBoxComponent {
 public:
  FVector GetScaledBoxExtent() const;
  FVector GetComponentLocation() const;
  FQuat GetComponentQuat() const;
};
