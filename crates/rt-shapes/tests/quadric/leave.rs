//! Rays that leave a surface do not meet it where they start.
