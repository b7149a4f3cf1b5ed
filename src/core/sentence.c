/* sentence.c - sentences about failures, put together without stdio: the core neither prints nor depends on a
 * locale.
 *
 * A message always ends within its 256 bytes. What does not fit is cut, never in the middle of a UTF-8 character.
 */
#include "internal.h"

void sentence_begin(rqt_message *message, const char *text) {
    if (!message) return;
    message->text[0] = '\0';
    sentence_add(message, text);
}

void sentence_add(rqt_message *message, const char *text) {
    if (!message) return;
    size_t used = strlen(message->text), room = sizeof message->text - 1 - used, n = strlen(text);
    if (n > room) {
        n = room;
        while (n > 0 && ((unsigned char)text[n] & 0xC0) == 0x80) n--;
    }
    memcpy(message->text + used, text, n);
    message->text[used + n] = '\0';
}

void sentence_add_integer(rqt_message *message, int64_t value) {
    char digits[24], *p = digits + sizeof digits - 1;
    uint64_t rest = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    *p = '\0';
    do {
        *--p = (char)('0' + rest % 10);
        rest /= 10;
    } while (rest);
    if (value < 0) *--p = '-';
    sentence_add(message, p);
}
