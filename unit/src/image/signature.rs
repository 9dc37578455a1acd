//! Signatures of images.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use minisign_verify::{PublicKey, Signature};

use super::Image;

impl Image {
    /// Checks the signature beside the image (`IMAGE.minisig`) against the public key in the file `key`; returns the
    /// signer's comment on the image, which is signed too.
    ///
    /// # Errors
    /// Returns an error if one of the files cannot be read, or if the signature does not match this image and key.
    pub fn signed_by(&self, key: &Path) -> Result<String> {
        let public = PublicKey::decode(&input::text(key)?).map_err(|error| {
            Problem::bad_input(format!("this is not a minisign public key: {error}")).in_file(key)
        })?;
        let mut place = self.path.clone().into_os_string();
        place.push(".minisig");
        let place = PathBuf::from(place);
        let signature = Signature::decode(&input::text(&place)?).map_err(|error| {
            Problem::bad_input(format!("this is not a minisign signature: {error}")).in_file(&place)
        })?;
        public
            .verify(&self.bytes, &signature, false)
            .map_err(|error| {
                Problem::disagreement(format!(
                    "the image does not match its signature by this key: {error}"
                ))
                .in_file(&self.path)
                .help("do not flash it; download the image, its signature and the key again")
            })?;
        Ok(signature.trusted_comment().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Shelf, file};
    use super::*;

    /// A key made for this test, and its signature of `file(2)`.
    const KEY: &str = "untrusted comment: minisign public key F51737B376A8EB77\n\
        RWR366h2szcX9TBRd2IHh6iDoEMqAn6ROTeUq2KtfzQbCn86Zh8aIzu1\n";
    const SIGNATURE: &str = "untrusted comment: a signature for a test\n\
        RUR366h2szcX9ciVdjbNejAxt2kZl9OEHVUlq5BhViyJIAo6nvFbXBeOlolzvff1n0ZQs4aRiUsNt1l1DV0RwJ7ED1A0MxUSIwc=\n\
        trusted comment: rp2350-pico2 a26fce5b\n\
        kfa31dE0Pd+iHhnQBFkQyI9Ao9gQGc1qdYEqpT4ElPVY3g3fES1Vj1iU7jwX2FBg0GpXJlfGIG/mBu6/r8zgDg==\n";

    #[test]
    fn a_signature_is_valid_for_one_image_and_one_key() {
        let shelf = Shelf::new();
        let key = shelf.put("minisign.pub", KEY);
        let path = shelf.put("unit.uf2", file(2));
        assert!(
            Image::read(&path).unwrap().signed_by(&key).is_err(),
            "no signature"
        );
        shelf.put("unit.uf2.minisig", SIGNATURE);
        let comment = Image::read(&path).unwrap().signed_by(&key);
        assert_eq!(comment.unwrap(), "rp2350-pico2 a26fce5b");
        // Another image, also complete.
        let mut changed = file(2);
        changed[100] ^= 1;
        shelf.put("unit.uf2", changed);
        let problem = Image::read(&path).unwrap().signed_by(&key).unwrap_err();
        assert!(
            problem.to_string().contains("does not match its signature"),
            "{problem}"
        );
        // The signer's comment is signed too.
        shelf.put("unit.uf2", file(2));
        shelf.put(
            "unit.uf2.minisig",
            SIGNATURE.replace("a26fce5b", "a26fce5c"),
        );
        assert!(Image::read(&path).unwrap().signed_by(&key).is_err());
        let nonsense = shelf.put("key", "nonsense");
        assert!(Image::read(&path).unwrap().signed_by(&nonsense).is_err());
    }
}
