//! Descriptions of messages, which a file carries so that any reader can decode them (`google/protobuf/descriptor.proto`).

use super::Message;

/// What a field holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A number of 64 bits.
    Double,
    /// A number of 32 bits.
    Float,
    /// A whole number of 64 bits.
    Int64,
    /// A whole number of 32 bits.
    Int32,
    /// A whole number of 32 bits, always stored as four bytes.
    Fixed32,
    /// A truth value.
    Flag,
    /// Text.
    Text,
    /// Bytes.
    Bytes,
    /// A message, by its full name.
    Of(&'static str),
    /// The enumeration `Type` in the message of this full name.
    TypeIn(&'static str),
}

impl Kind {
    /// The number of the type in a description, and the name of a message or an enumeration.
    fn described(self) -> (u64, Option<String>) {
        match self {
            Self::Double => (1, None),
            Self::Float => (2, None),
            Self::Int64 => (3, None),
            Self::Int32 => (5, None),
            Self::Fixed32 => (7, None),
            Self::Flag => (8, None),
            Self::Text => (9, None),
            Self::Bytes => (12, None),
            Self::Of(name) => (11, Some(format!(".{name}"))),
            Self::TypeIn(name) => (14, Some(format!(".{name}.Type"))),
        }
    }
}

/// A field; its number is its place in the message, from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// What it holds.
    pub kind: Kind,
    /// Whether it may occur several times.
    pub is_repeated: bool,
    /// Its meaning; may be empty.
    pub meaning: String,
}

/// A kind of message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Type {
    /// Its name, without the package.
    pub name: String,
    /// Its fields.
    pub fields: Vec<Field>,
    /// The values of its enumeration `Type`, from 0; empty if it has none.
    pub values: &'static [&'static str],
}

impl Type {
    fn describe(&self, out: &mut Message) {
        out.text(1, &self.name);
        for (number, field) in (1..).zip(&self.fields) {
            let (kind, name) = field.kind.described();
            out.message(2, |out| {
                out.text(1, &field.name);
                out.whole(3, number);
                out.whole(4, if field.is_repeated { 3 } else { 1 });
                out.whole(5, kind);
                if let Some(name) = &name {
                    out.text(6, name);
                }
            });
        }
        if !self.values.is_empty() {
            out.message(4, |out| {
                out.text(1, "Type");
                for (number, value) in (0..).zip(self.values) {
                    out.message(2, |out| {
                        out.text(1, value);
                        out.whole(2, number);
                    });
                }
            });
        }
    }
}

/// A file of types.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Its name, such as `foxglove/Pose.proto`.
    pub name: String,
    /// Its package.
    pub package: &'static str,
    /// Names of the files that it needs.
    pub imports: Vec<String>,
    /// Its types.
    pub types: Vec<Type>,
}

impl File {
    fn describe(&self, out: &mut Message) {
        out.text(1, &self.name);
        out.text(2, self.package);
        self.imports.iter().for_each(|import| out.text(3, import));
        for one in &self.types {
            out.message(4, |out| one.describe(out));
        }
        out.message(9, |out| self.comments(out));
        out.text(12, "proto3");
    }

    /// Meanings, where compilers put comments.
    fn comments(&self, out: &mut Message) {
        for (place, one) in (0..).zip(&self.types) {
            for (field, Field { meaning, .. }) in (0..).zip(&one.fields) {
                if !meaning.is_empty() {
                    out.message(1, |out| {
                        out.wholes(1, &[4, place, 2, field]);
                        out.wholes(2, &[0, 0, 0]);
                        out.text(3, meaning);
                    });
                }
            }
        }
    }
}

/// The `FileDescriptorSet` of files, each after those that it needs.
pub fn described(files: &[File]) -> Vec<u8> {
    let mut set = Message::default();
    for file in files {
        set.message(1, |out| file.describe(out));
    }
    set.into_bytes()
}
