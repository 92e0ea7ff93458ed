//! Bytes to checked messages and back. Knows layouts, nothing of navigation.
