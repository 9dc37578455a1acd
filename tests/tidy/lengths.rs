//! Length limits of functions; those of TypeScript are measured by the page's linter.

use std::ffi::OsStr;
use std::path::Path;

use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use super::items::is_cfg_test;

/// Longest function, from opening to closing brace. Longer ones usually do several things.
const LINE_LIMIT: usize = 75;
/// Longest function in test code, where a long table of cases is acceptable.
const TEST_LINE_LIMIT: usize = 120;

/// A function and its length.
struct Function {
    name: String,
    line: usize,
    lines: usize,
    of_test: bool,
}

impl Function {
    fn is_longer_than(&self, limit: usize, test_limit: usize) -> bool {
        self.lines > if self.of_test { test_limit } else { limit }
    }
}

/// Collects the functions of a file with their lengths.
struct Functions {
    of_test: bool,
    found: Vec<Function>,
}

impl Functions {
    fn measure(&mut self, signature: &syn::Signature, block: &syn::Block) {
        let (begin, end) = (block.span().start().line, block.span().end().line);
        self.found.push(Function {
            name: signature.ident.to_string(),
            line: begin,
            lines: end - begin + 1,
            of_test: self.of_test,
        });
    }
}

impl<'a> Visit<'a> for Functions {
    fn visit_item_mod(&mut self, item: &'a syn::ItemMod) {
        let around = self.of_test;
        self.of_test |= is_cfg_test(&item.attrs);
        visit::visit_item_mod(self, item);
        self.of_test = around;
    }

    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        self.measure(&item.sig, &item.block);
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        self.measure(&item.sig, &item.block);
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'a syn::TraitItemFn) {
        if let Some(block) = &item.default {
            self.measure(&item.sig, block);
        }
        visit::visit_trait_item_fn(self, item);
    }
}

/// Functions of a source file.
fn functions(path: &Path, text: &str) -> Vec<Function> {
    let syntax =
        syn::parse_file(text).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let is_tests = |part: &OsStr| part == "tests" || part == "tests.rs";
    let mut functions = Functions {
        of_test: path.iter().any(is_tests),
        found: Vec::new(),
    };
    functions.visit_file(&syntax);
    functions.found
}

#[test]
fn every_function_is_short() {
    let mut faults = Vec::new();
    for (path, text) in crate::sources() {
        let path = path.strip_prefix(crate::root()).unwrap_or(&path);
        for function in functions(path, &text) {
            if function.is_longer_than(LINE_LIMIT, TEST_LINE_LIMIT) {
                let Function {
                    name, line, lines, ..
                } = function;
                faults.push(format!(
                    "{}:{line}: {name} has {lines} lines",
                    path.display()
                ));
            }
        }
    }
    assert!(
        faults.is_empty(),
        "functions of more than {LINE_LIMIT} lines, of tests more than {TEST_LINE_LIMIT}:\n{}",
        faults.join("\n")
    );
}

#[test]
fn functions_are_measured_wherever_they_stand() {
    let body = "{\n    let a = 1;\n    let _ = a;\n}\n";
    let text = format!(
        "fn free() {body} struct S; impl S {{ fn method() {body} }} trait T {{ fn given() {body} fn asked(); }} \
         mod m {{ fn inner() {{ fn innermost() {body} }} }} #[cfg(test)] mod tests {{ fn test() {body} }} fn short() {{}}"
    );
    let found = |path, limit, test_limit| -> Vec<String> {
        let functions = functions(Path::new(path), &text).into_iter();
        let long = functions.filter(|function| function.is_longer_than(limit, test_limit));
        long.map(|function| function.name).collect()
    };
    let code = ["free", "method", "given", "inner", "innermost"];
    assert_eq!(found("core/src/text.rs", 3, 4), code);
    assert_eq!(found("core/src/text.rs", 5, 3), ["test"]);
    assert!(found("tests/text.rs", 3, 5).is_empty());
    assert!(found("core/src/text/tests.rs", 3, 5).is_empty());
}
