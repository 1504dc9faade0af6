#pragma once
#include "CoreMinimal.h"

class AActor {
 public:
  uint32 GetUniqueID() const;
  FVector GetActorLocation() const;
  FQuat GetActorQuat() const;
};
