#pragma once
#include "CoreMinimal.h"

class USkeletalMeshComponent {
 public:
  uint32 GetUniqueID() const;
  FVector GetSocketLocation(FName socket_or_bone) const;
};
