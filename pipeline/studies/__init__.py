"""Studies of estimators and images: verify, agreement, the contact ladder and regions."""
