//! The list of all models; nothing else lists them.
