#pragma once

class UWorld {
 public:
  double GetTimeSeconds() const;
};
