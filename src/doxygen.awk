# The head of a header, its first block of // lines, becomes the description of the file.
!seen && /^\/\// { seen = 1; inside = 1; print "/** \\file"; print "\\verbatim" }
inside && !/^\/\// { inside = 0; print "\\endverbatim */" }
inside { sub(/^\/\/ ?/, "") }
{ print }
