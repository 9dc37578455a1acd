//! Trim: the steady fall of a symmetric posture, paper "The Trim Condition".
